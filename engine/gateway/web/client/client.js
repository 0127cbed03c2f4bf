import { read, write } from "./codec.js";
import { History } from "./history.js";
import { DisplayClock, Tracks } from "./interpolation.js";
import { Prediction } from "./prediction.js";
import { Replica } from "./replica.js";
import { WebSocketTransport } from "./transport.js";
import { readParameters } from "./walk.js";

export { quantum } from "./codec.js";

const finalCodes = new Set([4400, 4401, 4403, 4409]); // connecting again would end in the same way
const firstRetry_ms = 250, longestRetry_ms = 8000;
const rateWindow_ms = 1000;

/** An event of a Client; `detail` has what came. */
class ClientEvent extends Event {
  constructor(type, detail) {
    super(type);
    this.detail = detail;
  }
}

/**
 * A client of a Ringfence gateway: a player (path /play), or a spectator or operator (/watch).
 *
 * Events, each with `detail`: `open` (the welcome), `close` ({ code, reason, isFinal }), `update`, `shape`, `status`,
 * `described`, `notice`, `application`.
 */
export class Client extends EventTarget {
  /**
   * @param {string} url of the gateway, such as http://127.0.0.1:8080
   * @param {object} [options]
   * @param {string} [options.path] /play or /watch
   * @param {string} [options.token] of the player; empty: a guest
   * @param {Function} [options.WebSocket] class of WebSockets, where there is no global one (Node 18 and 20: `ws`)
   * @param {boolean} [options.reconnect] connect again after an interruption; a guest comes back to its avatar
   * @param {Function} [options.makeTransport] (url) → transport, instead of WebSocket; see transport.js
   * @param {Function} [options.now] milliseconds of a clock
   * @param {number} [options.historyBytes] memory for the last minute; 0: it is not kept
   * @param {number} [options.fastest] m/s: faster objects have jumped
   */
  constructor(url, { path = "/play", token = "", WebSocket = globalThis.WebSocket, reconnect = true, makeTransport,
    now = () => performance.now(), historyBytes = 0, fastest = 50 } = {}) {
    super();
    this.url = new URL(path, url).href;
    this.token = token;
    this.reconnect = reconnect;
    this.makeTransport = makeTransport ?? ((address) => new WebSocketTransport(address, WebSocket));
    this.now = now;
    this.fastest = fastest;
    /** number → shape: { kind, radius, half, halfLength, points, triangles } as its kind has them, metres. */
    this.shapes = new Map();
    this.history = historyBytes > 0 ? new History(historyBytes) : null;
    this.retry_ms = firstRetry_ms;
    this.reset();
  }
  reset() {
    this.welcome = null;
    this.replica = new Replica();
    this.tracks = new Tracks(this.fastest);
    this.clock = new DisplayClock();
    this.prediction = null;
    this.requestedShapes = new Set();
    this.received = []; // { at, bytes } of the last second
    this.statistics = { frame: -1, serverTime: 0, ping_ms: 0, delay_ms: 0, bytesPerSecond: 0, updatesPerSecond: 0,
      objects: 0, ignoredUpdates: 0 };
  }

  connect() {
    this.isWanted = true;
    clearTimeout(this.retryTimer);
    this.reset();
    const transport = this.makeTransport(this.url);
    this.transport = transport;
    transport.onopen = () => transport.send(write.hello(this.token));
    transport.onmessage = (bytes) => { if (this.transport === transport) this.receive(bytes); };
    transport.onclose = (event) => { if (this.transport === transport) this.lost(event); };
  }
  close() {
    this.isWanted = false;
    clearTimeout(this.retryTimer);
    clearInterval(this.ticker);
    this.transport?.close();
  }

  /** What the player wants: { x, y: -1 to 1, heading: radians, run }. It holds until the next call. */
  setInput(wish) { this.prediction?.setInput(wish); }
  /** The part of the world that a spectator sees. */
  setView(centre, radius) { this.send(write.view(centre, radius)); }
  /** Asks for the state of an object; the answer is the event `described`. */
  describe(number) { this.send(write.describe(number)); }
  /** Of operators: "nodes" (count), "kill" (node id), "robots" (count); the answer is the event `notice`. */
  command(name, value) { this.send(write.command(name, value)); }
  sendApplication(bytes) { this.send(write.application(bytes)); }
  send(message) { if (this.welcome !== null) this.transport.send(message); }

  /** number → object as received last: { number, generation, shape, category, user, metadata, position, orientation }. */
  get objects() { return this.replica.objects; }
  /** Of the own avatar: { number, phase, age, normal, depth, point }. */
  get contacts() { return this.replica.contacts; }
  /** Of spectators: [a, b] of the objects that touch each other in the view. */
  get touching() { return this.replica.touching; }
  /** The own avatar as received last, or null. */
  get own() { return this.replica.own; }

  /** Where to draw the own avatar now: { x, y, z, heading, vx, vy }; null if there is none. */
  predictOwn(now = this.now()) {
    if (this.prediction?.state) return this.prediction.drawn(now);
    return null;
  }
  /** Calls visit(object, x, y, z, qx, qy, qz, qw) for each other object, where to draw it now. */
  sample(visit, now = this.now()) {
    const time = this.clock.display(now);
    this.statistics.delay_ms = this.clock.delay;
    this.tracks.sample(time, this.objects, visit);
  }
  /** The same at a server time of the history, and { own, contacts, touching, frame } of that time. */
  sampleHistory(time, visit) {
    const found = this.history?.at(time);
    if (!found) return null;
    found.tracks.sample(time, found.replica.objects, visit);
    const { own, contacts, touching, frame } = found.replica;
    return { own, contacts, touching, frame };
  }
  /** Objects that are faster, m/s, have jumped: they are not drawn between two places. */
  setFastest(fastest) {
    this.fastest = this.tracks.fastest = fastest;
    if (this.history !== null) this.history.fastest = fastest;
  }

  receive(bytes) {
    this.count(bytes.length);
    try {
      this.handle(read(bytes), bytes);
    } catch (error) {
      if (!(error instanceof RangeError)) throw error;
      this.close();
      this.emit("notice", `The gateway sent a message that this client cannot read: ${error.message}`);
    }
  }
  handle(message, bytes) {
    switch (message.type) {
      case "welcome": return this.begin(message);
      case "update": return this.welcome === null ? undefined : this.update(message, bytes);
      case "shape": this.shapes.set(message.shape, message); return this.emit("shape", message);
      case "status": return this.emit("status", message.status);
      case "described": return this.emit("described", message.object);
      case "notice": return this.emit("notice", message.text);
      default: return this.emit("application", message.body);
    }
  }
  begin(welcome) {
    this.welcome = welcome;
    this.retry_ms = firstRetry_ms;
    if (welcome.token !== "") this.token = welcome.token;
    if (welcome.model === "walk") {
      welcome.parameters = readParameters(welcome.parameters);
      if (welcome.role === "play") this.predict(welcome);
    }
    this.emit("open", welcome);
  }
  predict(welcome) {
    this.prediction = new Prediction(welcome.parameters, welcome.bounds);
    this.nextTick = this.now();
    clearInterval(this.ticker);
    this.ticker = setInterval(() => this.advance(), this.prediction.tick_ms / 4);
  }
  /** Runs the ticks that are due; after a pause not more than a second of them. */
  advance() {
    const now = this.now(), tick_ms = this.prediction.tick_ms;
    if (now - this.nextTick > 1000) this.nextTick = now;
    while (this.nextTick <= now) {
      const isNew = this.prediction.tick(this.nextTick, this.objects, this.shapes);
      if (isNew || this.prediction.hasUnacknowledged) this.sendInput(now);
      this.nextTick += tick_ms;
    }
  }
  sendInput(now) {
    const { sequence, bytes } = this.prediction;
    this.send(write.input(this.replica.acknowledgement, sequence, Math.floor(now) & 65535, bytes));
  }

  update(update, bytes) {
    const now = this.now();
    if (!this.replica.apply(update)) {
      ++this.statistics.ignoredUpdates;
      return;
    }
    this.tracks.add(update, this.objects);
    this.clock.add(update.time / 1000, now);
    this.history?.add(update, bytes, this.replica);
    if (update.own !== null) this.request(update.own.shape);
    for (const { shape } of update.entered) this.request(shape);
    this.prediction?.reconcile(update, now, this.objects, this.shapes);
    if (!this.prediction?.hasUnacknowledged) this.send(write.ack(this.replica.acknowledgement));
    const { statistics } = this;
    Object.assign(statistics, { frame: update.frame, serverTime: update.time / 1000, objects: this.objects.size });
    if (update.sequence > 0) this.measure(update, now);
    this.emit("update", update);
  }
  /** The way to the gateway and back: the age of the echoed input without the time that the gateway held it. */
  measure({ echo, hold }, now) {
    const { statistics } = this;
    const age = ((Math.floor(now) & 65535) - echo - hold) & 65535;
    if (age > 32767) return; // the echo is older than the 65 s that it can tell apart
    statistics.ping_ms = statistics.ping_ms === 0 ? age : statistics.ping_ms + (age - statistics.ping_ms) * 0.1;
  }
  request(shape) {
    if (this.shapes.has(shape) || this.requestedShapes.has(shape)) return;
    this.requestedShapes.add(shape);
    this.send(write.getShape(shape));
  }

  count(bytes) {
    const at = this.now();
    this.received.push({ at, bytes });
    while (at - this.received[0].at > rateWindow_ms) this.received.shift();
    this.statistics.updatesPerSecond = this.received.length;
    this.statistics.bytesPerSecond = this.received.reduce((sum, each) => sum + each.bytes, 0);
  }
  lost({ code, reason }) {
    clearInterval(this.ticker);
    const isFinal = !this.isWanted || !this.reconnect || finalCodes.has(code);
    if (!isFinal) {
      this.retryTimer = setTimeout(() => this.connect(), this.retry_ms * (0.75 + 0.5 * Math.random()));
      this.retry_ms = Math.min(2 * this.retry_ms, longestRetry_ms);
    }
    this.emit("close", { code, reason, isFinal });
  }
  emit(type, detail) { this.dispatchEvent(new ClientEvent(type, detail)); }
}
