import { read } from "./codec.js";
import { Tracks } from "./interpolation.js";
import { Replica } from "./replica.js";

const keyInterval_ms = 2000;
const bytesOfObject = 200; // estimate for an object of a key frame

/**
 * The last minute of what a client received: the messages as they came, and every two seconds a copy of the objects, from
 * which any moment is computed again.
 */
export class History {
  constructor(maxBytes, max_ms = 60000) {
    this.maxBytes = maxBytes;
    this.max_ms = max_ms;
    this.entries = []; // { time, bytes, key: objects or null, own, contacts }
    this.bytes = 0;
    this.cursor = null; // { index, replica, tracks }
    this.fastest = undefined; // m/s: of Tracks
  }
  /** Adds an update that the replica has applied. */
  add(update, message, replica) {
    const time = update.time / 1000;
    const lastKey = this.entries.findLast((entry) => entry.key !== null);
    const isKey = lastKey === undefined || time - lastKey.time >= keyInterval_ms || update.since === 0;
    const key = isKey ? new Map(Array.from(replica.objects, ([number, object]) => [number, { ...object }])) : null;
    const entry = { time, frame: update.frame, message: message.slice(), key };
    entry.size = entry.message.length + (key === null ? 0 : key.size * bytesOfObject);
    this.entries.push(entry);
    this.bytes += entry.size;
    while (this.entries.length > 1 && (this.bytes > this.maxBytes || time - this.entries[0].time > this.max_ms)) {
      this.dropOldest();
    }
  }
  /** Removes the oldest key frame with what depends on it. */
  dropOldest() {
    const next = this.entries.findIndex((entry, index) => index > 0 && entry.key !== null);
    const removed = this.entries.splice(0, next < 0 ? this.entries.length - 1 : next);
    for (const entry of removed) this.bytes -= entry.size;
    this.cursor = null;
  }
  /** First and last server time, ms; null if it is empty. */
  get range() {
    return this.entries.length === 0 ? null : [this.entries[0].time, this.entries[this.entries.length - 1].time];
  }

  /** The state at a server time: { replica, tracks }. The one before is used again if time goes on. */
  at(time) {
    let index = this.entries.findLastIndex((entry) => entry.time <= time);
    // One update further, between which and the one before the poses are interpolated.
    index = Math.min(Math.max(index, 0) + 1, this.entries.length - 1);
    if (index < 0) return null;
    if (this.cursor === null || this.cursor.index > index || index - this.cursor.index > 100) this.seek(index);
    while (this.cursor.index < index) this.advance();
    return this.cursor;
  }
  seek(index) {
    let first = this.entries.findLastIndex((entry, at) => entry.key !== null && at < index);
    if (first < 0) first = this.entries.findIndex((entry) => entry.key !== null);
    const { key, message, time } = this.entries[first < 0 ? 0 : first];
    const update = read(message);
    const replica = new Replica();
    for (const [number, object] of key ?? []) replica.objects.set(number, { ...object });
    Object.assign(replica, { frame: update.frame, own: update.own, contacts: update.contacts,
      touching: update.touching });
    const tracks = new Tracks(this.fastest);
    for (const object of replica.objects.values()) tracks.addState(object.number, object, time);
    tracks.before = time;
    this.cursor = { index: Math.max(first, 0), replica, tracks };
  }
  advance() {
    const update = read(this.entries[++this.cursor.index].message);
    if (this.cursor.replica.apply(update)) this.cursor.tracks.add(update, this.cursor.replica.objects);
  }
}
