// Other objects are drawn a little in the past, between two states that were received, so that they move evenly although
// updates arrive unevenly.

const samples = 8; // states of an object that are kept
const fields = 8; // time, position, orientation
const keptOffsets = 128; // updates from which the delay is estimated
const settling_ms = 400; // time in which the delay adapts
const slack_ms = 5;

/** Converts the client's clock to the time of the server that is displayed. */
export class DisplayClock {
  constructor() {
    this.offsets = []; // arrival minus server time, ms
    this.interval = 50;
    this.delay = 0;
    this.base = 0;
    this.adaptedAt = 0;
    this.last = 0;
  }
  add(serverTime, arrival) {
    if (this.offsets.length > 0 && serverTime > this.last) {
      this.interval += 0.05 * (Math.min(serverTime - this.last, 1000) - this.interval);
    }
    this.last = serverTime;
    this.offsets.push(arrival - serverTime);
    if (this.offsets.length > keptOffsets) this.offsets.shift();
    this.base = Math.min(...this.offsets);
    // All but the latest few of a hundred updates are in time.
    const late = this.offsets.map((offset) => offset - this.base).sort((a, b) => a - b);
    this.wanted = this.interval + late[Math.floor((late.length - 1) * 0.97)] + slack_ms;
    if (this.offsets.length === 1) this.delay = this.wanted;
  }
  /** Server time to display now, ms. */
  display(now) {
    const passed = Math.max(0, now - this.adaptedAt);
    this.adaptedAt = now;
    if (this.wanted !== undefined) this.delay += (this.wanted - this.delay) * (1 - Math.exp(-passed / settling_ms));
    return now - this.base - this.delay;
  }
}

/** The newest states of the objects that move. */
export class Tracks {
  /** `fastest`: m/s; what is faster has jumped and is not interpolated. */
  constructor(fastest = 50) {
    this.fastest = fastest;
    this.tracks = new Map(); // number → { values: Float64Array, count }
    this.before = 0; // server time of the update before, ms
  }
  /** Adds the states of an update that the replica has applied. */
  add(update, objects) {
    const time = update.time / 1000;
    if (update.since === 0) this.tracks.clear();
    for (const number of update.removed) this.tracks.delete(number);
    for (const { number } of update.entered) this.addState(number, objects.get(number), time);
    for (const { number } of update.moved) this.addState(number, objects.get(number), time);
    this.before = time;
  }
  addState(number, object, time) {
    let track = this.tracks.get(number);
    if (track === undefined || track.generation !== object.generation) {
      track = { values: new Float64Array(samples * fields), count: 0, generation: object.generation };
      this.tracks.set(number, track);
    }
    // An object that is in no update did not move until the update before this one.
    if (track.count > 0 && track.values[(track.count - 1) * fields] < this.before) {
      const last = track.values.slice((track.count - 1) * fields, track.count * fields);
      last[0] = this.before;
      this.push(track, last);
    }
    const { position: p, orientation: q } = object;
    this.push(track, [time, p[0], p[1], p[2], q[0], q[1], q[2], q[3]]);
  }
  push(track, state) {
    if (track.count === samples) {
      track.values.copyWithin(0, fields);
      --track.count;
    }
    track.values.set(state, track.count++ * fields);
  }

  /** Calls visit(object, x, y, z, qx, qy, qz, qw) for each object, with its pose at a server time. */
  sample(time, objects, visit) {
    for (const object of objects.values()) {
      const track = this.tracks.get(object.number);
      if (track === undefined || track.count < 2 || !this.visitBetween(track, time, object, visit)) {
        const { position: p, orientation: q } = object;
        visit(object, p[0], p[1], p[2], q[0], q[1], q[2], q[3]);
      }
    }
  }
  visitBetween({ values: v, count }, time, object, visit) {
    if (time >= v[(count - 1) * fields]) return false; // the newest
    let after = count - 1;
    while (after > 0 && v[(after - 1) * fields] > time) --after;
    if (after === 0) {
      visit(object, v[1], v[2], v[3], v[4], v[5], v[6], v[7]);
      return true;
    }
    const a = (after - 1) * fields, b = after * fields;
    const dx = v[b + 1] - v[a + 1], dy = v[b + 2] - v[a + 2], dz = v[b + 3] - v[a + 3];
    const between = v[b] - v[a];
    const reach = (this.fastest * between) / 1000 + 0.5;
    const jumps = dx * dx + dy * dy + dz * dz > reach * reach;
    const t = jumps || between <= 0 ? 0 : (time - v[a]) / between;
    // The shorter way of the rotation.
    const dot = v[a + 4] * v[b + 4] + v[a + 5] * v[b + 5] + v[a + 6] * v[b + 6] + v[a + 7] * v[b + 7];
    const w = dot < 0 ? -t : t, u = 1 - t;
    const x = u * v[a + 4] + w * v[b + 4], y = u * v[a + 5] + w * v[b + 5];
    const z = u * v[a + 6] + w * v[b + 6], k = u * v[a + 7] + w * v[b + 7];
    const scale = 1 / (Math.hypot(x, y, z, k) || 1);
    visit(object, v[a + 1] + dx * t, v[a + 2] + dy * t, v[a + 3] + dz * t, x * scale, y * scale, z * scale, k * scale);
    return true;
  }
}
