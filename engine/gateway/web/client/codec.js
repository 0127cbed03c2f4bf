// The messages between clients and the gateway, as docs/client-protocol.md describes them.

/** Metres in a quantum of positions. */
export const quantum = 2 ** -9;

export const clientMessage = { hello: 1, input: 2, ack: 3, getShape: 4, application: 5, view: 6, describe: 7, command: 8 };
export const serverMessage = { welcome: 1, update: 2, shape: 3, application: 4, status: 5, described: 6, notice: 7 };

const version = 1;
const roles = ["play", "watch", "operate"];
const phases = ["begin", "persist", "end"];
const shapeKinds = ["sphere", "box", "capsule", "hull", "mesh", "other"];
const commands = { nodes: 1, kill: 2, robots: 3 };

/** Reads values from the bytes of a message. Throws RangeError at the end of the bytes. */
export class Reader {
  constructor(bytes) {
    this.bytes = bytes instanceof Uint8Array ? bytes : new Uint8Array(bytes);
    this.view = new DataView(this.bytes.buffer, this.bytes.byteOffset, this.bytes.byteLength);
    this.at = 0;
  }
  take(size) {
    const begin = this.at;
    if (!(size <= this.bytes.length - begin)) throw new RangeError("the message is too short");
    this.at += size;
    return begin;
  }
  u8() { return this.bytes[this.take(1)]; }
  u16() { return this.view.getUint16(this.take(2), true); }
  u32() { return this.view.getUint32(this.take(4), true); }
  f32() { return this.view.getFloat32(this.take(4), true); }
  f64() { return this.view.getFloat64(this.take(8), true); }
  i8() { return this.view.getInt8(this.take(1)); }
  /** A var. Above 2^53 the nearest number. */
  var() {
    let value = 0;
    for (let scale = 1, bytes = 0; bytes < 10; scale *= 128, ++bytes) {
      const byte = this.u8();
      value += (byte & 127) * scale;
      if (byte < 128) return value;
    }
    throw new RangeError("a number of more than 10 bytes");
  }
  svar() {
    const value = this.var();
    return value % 2 === 0 ? value / 2 : -(value - 1) / 2 - 1;
  }
  raw(size) {
    const begin = this.take(size);
    return this.bytes.subarray(begin, begin + size);
  }
  lengthBytes() { return this.raw(this.var()); }
  text() { return new TextDecoder().decode(this.lengthBytes()); }
  rest() { return this.raw(this.bytes.length - this.at); }
  /** A count whose records of `size` bytes at least fit into the rest of the message. */
  check(count, size) {
    if (count * size > this.bytes.length - this.at) throw new RangeError("the message is too short");
    return count;
  }
  /** A position relative to an origin in quanta, in metres. */
  offset(origin) {
    const position = new Float64Array(3);
    for (let axis = 0; axis < 3; ++axis) position[axis] = (origin[axis] + this.svar()) * quantum;
    return position;
  }
  turn() { return turnOf(this.u32()); }
}

/** The unit quaternion [x, y, z, w] of a turn. */
export function turnOf(bits) {
  const omitted = bits >>> 30;
  const quaternion = new Float32Array(4);
  let sum = 0;
  for (let index = 0, shift = 0; index < 4; ++index) {
    if (index === omitted) continue;
    const value = ((((bits >>> shift) & 1023) / 1023) * 2 - 1) * Math.SQRT1_2;
    quaternion[index] = value;
    sum += value * value;
    shift += 10;
  }
  quaternion[omitted] = Math.sqrt(Math.max(0, 1 - sum));
  const length = Math.hypot(...quaternion);
  for (let index = 0; index < 4; ++index) quaternion[index] /= length;
  return quaternion;
}

/** Collects the bytes of a message. */
export class Writer {
  constructor(type) { this.bytes = [type]; }
  u8(value) { this.bytes.push(value & 255); return this; }
  u16(value) { return this.u8(value).u8(value >>> 8); }
  f64(value) {
    const bytes = new Uint8Array(8);
    new DataView(bytes.buffer).setFloat64(0, value, true);
    return this.raw(bytes);
  }
  var(value) {
    while (value >= 128) {
      this.bytes.push((value % 128) + 128);
      value = Math.floor(value / 128);
    }
    return this.u8(value);
  }
  raw(bytes) { for (const byte of bytes) this.bytes.push(byte); return this; }
  lengthBytes(bytes) { return this.var(bytes.length).raw(bytes); }
  text(text) { return this.lengthBytes(new TextEncoder().encode(text)); }
  message() { return new Uint8Array(this.bytes); }
}

const writer = (name) => new Writer(clientMessage[name]);
export const write = {
  hello: (token) => writer("hello").u8(version).text(token).message(),
  input: (ack, sequence, time, body) => writer("input").var(ack).var(sequence).u16(time).lengthBytes(body).message(),
  ack: (ack) => writer("ack").var(ack).message(),
  getShape: (shape) => writer("getShape").var(shape).message(),
  application: (body) => writer("application").raw(body).message(),
  view: (centre, radius) => writer("view").f64(centre[0]).f64(centre[1]).f64(centre[2]).f64(radius).message(),
  describe: (number) => writer("describe").var(number).message(),
  command: (name, value) => writer("command").u8(commands[name]).var(value).message(),
};

function readWelcome(reader) {
  const found = reader.u8();
  if (found !== version) throw new RangeError(`the gateway has protocol version ${found}, this client has ${version}`);
  const welcome = { role: roles[reader.u8()], user: reader.var() - 1, avatar: reader.var(), frame: reader.var() - 1,
    rate: reader.f32(), interest: reader.f32() };
  welcome.bounds = Array.from({ length: 6 }, () => reader.f64());
  welcome.world = reader.text();
  welcome.model = reader.text();
  welcome.parameters = reader.lengthBytes().slice();
  welcome.token = reader.text();
  return welcome;
}

function readOwn(reader) {
  const number = reader.var(), shape = reader.var();
  const position = Float64Array.of(reader.f64(), reader.f64(), reader.f64());
  const orientation = Float32Array.of(reader.f32(), reader.f32(), reader.f32(), reader.f32());
  return { number, shape, position, orientation, state: reader.lengthBytes().slice() };
}

/** Reads `count` records in ascending order of number; `read` has the rest of a record. */
function readRecords(reader, read) {
  const records = [];
  let number = 0;
  for (let left = reader.check(reader.var(), 1); left > 0; --left) records.push(read((step) => (number += step)));
  return records;
}

function readEntered(reader, origin) {
  return readRecords(reader, (next) => ({
    number: next(reader.var()), generation: reader.var(), shape: reader.var(), category: reader.u8(),
    user: reader.var() - 1, metadata: reader.lengthBytes().slice(), position: reader.offset(origin),
    orientation: reader.turn() }));
}

function readMoved(reader, origin) {
  return readRecords(reader, (next) => {
    const step = reader.var();
    const number = next(Math.floor(step / 2));
    const position = reader.offset(origin);
    return { number, position, orientation: step % 2 === 1 ? reader.turn() : null };
  });
}

function readContacts(reader, origin) {
  return readRecords(reader, (next) => {
    const contact = { number: next(reader.var()), phase: phases[reader.u8()], age: reader.var() };
    if (contact.phase === undefined) throw new RangeError("an unknown phase of a contact");
    if (contact.phase === "end") return contact;
    contact.normal = [reader.i8() / 127, reader.i8() / 127, reader.i8() / 127];
    contact.depth = reader.var() * quantum;
    contact.point = reader.offset(origin);
    return contact;
  });
}

function readTouching(reader) {
  return readRecords(reader, (next) => {
    const a = next(reader.var());
    return [a, a + reader.var()];
  });
}

function readUpdate(reader) {
  const flags = reader.u8();
  const update = { frame: reader.var(), since: reader.var(), time: reader.var(), sequence: reader.var(),
    age: reader.var(), echo: reader.u16(), hold: reader.var(), own: null };
  if (flags & 1) update.own = readOwn(reader);
  const origin = [reader.svar(), reader.svar(), reader.svar()];
  update.entered = readEntered(reader, origin);
  update.moved = readMoved(reader, origin);
  update.removed = readRecords(reader, (next) => next(reader.var()));
  update.contacts = readContacts(reader, origin);
  update.touching = flags & 2 ? readTouching(reader) : [];
  return update;
}

const points = (reader, count) => Float32Array.from({ length: reader.check(count, 12) * 3 }, () => reader.f32());

function readShape(reader) {
  const shape = reader.var();
  const kind = reader.u8();
  if (kind === 255) return { shape, kind: "none" };
  const description = { shape, kind: shapeKinds[kind] };
  switch (description.kind) {
    case "sphere": case "other": description.radius = reader.f32(); break;
    case "box": description.half = [reader.f32(), reader.f32(), reader.f32()]; break;
    case "capsule": description.radius = reader.f32(); description.halfLength = reader.f32(); break;
    case "hull": description.points = points(reader, reader.var()); break;
    case "mesh": {
      const vertices = reader.var(), triangles = reader.var();
      description.points = points(reader, vertices);
      description.triangles = Uint32Array.from({ length: reader.check(triangles, 3) * 3 }, () => reader.var());
      break;
    }
    default: throw new RangeError("an unknown kind of shape");
  }
  return description;
}

/** Reads a message of the gateway: { type, ... }. Throws RangeError if it is not as the protocol describes. */
export function read(bytes) {
  const reader = new Reader(bytes);
  const json = () => JSON.parse(new TextDecoder().decode(reader.rest()));
  const type = reader.u8();
  switch (type) {
    case serverMessage.welcome: return { type: "welcome", ...readWelcome(reader) };
    case serverMessage.update: return { type: "update", ...readUpdate(reader) };
    case serverMessage.shape: return { type: "shape", ...readShape(reader) };
    case serverMessage.application: return { type: "application", body: reader.rest() };
    case serverMessage.status: return { type: "status", status: json() };
    case serverMessage.described: return { type: "described", object: json() };
    case serverMessage.notice: return { type: "notice", text: new TextDecoder().decode(reader.rest()) };
    default: throw new RangeError(`a message of the unknown type ${type}`);
  }
}
