import { contactsAt, contactsOf, inputBytes, obstaclesNear, radiusOf, stateOf, step } from "./walk.js";

const keptTicks = 200; // 10 s at 20 frames per second
const smoothing_ms = 100; // time in which a correction fades to a third
const largestSmoothed = 1; // metres: larger corrections are jumps
const standing = inputBytes({});

/**
 * The own avatar ahead of the server: each tick of the client's clock is a frame that the server will compute with the
 * input of that tick. An update says which input had taken effect and for how many frames; the ticks after it are
 * computed again from the state of the update.
 */
export class Prediction {
  constructor(parameters, bounds) {
    this.parameters = parameters;
    this.bounds = bounds;
    this.ticks = []; // { sequence, bytes }, the newest last
    this.firstTicks = new Map(); // sequence → index of its first tick, counted from the first of all
    this.tickCount = 0;
    this.sequence = 0; // of the newest input
    this.acknowledged = 0; // newest input that the server has applied
    this.bytes = standing;
    this.state = null;
    this.radius = radiusOf(undefined); // metres, in the plane
    this.error = { x: 0, y: 0 }; // what is drawn minus what is predicted
    this.tickAt = 0; // ms
    this.errorAt = 0;
  }
  get tick_ms() { return this.parameters.step * 1000; }
  get hasUnacknowledged() { return this.sequence > this.acknowledged; }

  /** The wish from the next tick on. */
  setInput(wish) {
    const bytes = inputBytes(wish);
    if (bytes.every((byte, index) => byte === this.bytes[index])) return false;
    this.bytes = bytes;
    this.isChanged = true;
    return true;
  }

  /** One frame of the client's clock. Returns true if its input is a new one. */
  tick(now, objects, shapes) {
    const isNew = this.isChanged === true || this.sequence === 0;
    this.isChanged = false;
    if (isNew) this.firstTicks.set(++this.sequence, this.tickCount);
    this.ticks.push({ sequence: this.sequence, bytes: this.bytes });
    ++this.tickCount;
    this.tickAt = now;
    if (this.ticks.length > keptTicks) this.ticks.shift();
    for (const [sequence, first] of this.firstTicks) {
      if (sequence >= this.acknowledged && first >= this.tickCount - keptTicks) break;
      if (sequence !== this.acknowledged) this.firstTicks.delete(sequence);
    }
    if (this.state !== null) {
      const near = obstaclesNear(this.state.x, this.state.y, objects.values());
      const contacts = contactsAt(this.state.x, this.state.y, this.radius, near, shapes);
      step(this.state, this.bytes, contacts, this.parameters, this.bounds);
    }
    return isNew;
  }

  /** Starts again from an update: the state of the server, and the ticks that it has not computed yet. */
  reconcile(update, now, objects, shapes) {
    if (update.own === null) {
      this.state = null;
      return;
    }
    this.acknowledged = Math.max(this.acknowledged, update.sequence);
    const before = this.state === null ? null : this.drawn(now);
    this.radius = radiusOf(shapes.get(update.own.shape));
    const state = stateOf(update.own);
    const left = this.ticksAfter(update);
    const near = obstaclesNear(state.x, state.y, objects.values());
    let contacts = contactsOf(update.contacts, objects);
    for (const { bytes } of left) {
      step(state, bytes, contacts, this.parameters, this.bounds);
      contacts = contactsAt(state.x, state.y, this.radius, near, shapes);
    }
    this.state = state;
    if (before !== null) this.keepDrawn(before, now);
  }
  /** Ticks that the server has not computed. Those of an input that it has not received are among them. */
  ticksAfter({ sequence, age }) {
    const first = this.firstTicks.get(sequence);
    const next = this.firstTicks.get(sequence + 1) ?? this.tickCount;
    if (first === undefined && sequence > 0) return [];
    const done = sequence === 0 ? 0 : Math.min(first + age + 1, next);
    return this.ticks.slice(Math.max(0, done - (this.tickCount - this.ticks.length)));
  }
  keepDrawn(before, now) {
    const plain = this.extrapolated(now);
    this.error = { x: before.x - plain.x, y: before.y - plain.y };
    if (Math.hypot(this.error.x, this.error.y) > largestSmoothed) this.error = { x: 0, y: 0 };
    this.errorAt = now;
  }

  extrapolated(now) {
    const ahead = Math.max(0, Math.min(now - this.tickAt, this.tick_ms)) / 1000;
    return { x: this.state.x + this.state.vx * ahead, y: this.state.y + this.state.vy * ahead };
  }
  /** Where to draw the avatar. */
  drawn(now) {
    const { x, y } = this.extrapolated(now);
    const left = Math.exp(-(now - this.errorAt) / smoothing_ms);
    return { x: x + this.error.x * left, y: y + this.error.y * left, z: this.state.z, heading: this.state.heading,
      vx: this.state.vx, vy: this.state.vy };
  }
}
