// The motion model `walk`, as docs/client-protocol.md describes it, to predict the own avatar.

const slop = 0.02; // metres: overlap that is not resolved
const share = 0.5; // of the overlap beyond it, in a step
const pushDepth = 0.12; // metres: overlap with an object that gives way, at which pushing ends
const leastPlaneLength = 0.1; // of a normal in the plane: flatter contacts are floors
const usualRadius = 0.35; // metres: of an avatar whose shape is not known
const nonActive = 2, fixed = 3; // categories

/** The bytes of a wish { x, y, heading, run }: x and y from -1 to 1, heading in radians. */
export function inputBytes({ x = 0, y = 0, heading = 0, run = false }) {
  const part = (value) => Math.round(Math.max(-1, Math.min(1, value)) * 127) & 255;
  const turn = Math.round(heading * (65536 / (2 * Math.PI))) & 65535;
  return Uint8Array.of(part(x), part(y), turn & 255, turn >>> 8, run ? 1 : 0);
}

/** The parameters of `welcome`. */
export function readParameters(bytes) {
  const view = new DataView(bytes.buffer, bytes.byteOffset, bytes.byteLength);
  if (bytes.byteLength !== 20) throw new RangeError("the parameters of the model walk have 20 bytes");
  const [walkSpeed, runSpeed, acceleration, step, pushSpeed] = [0, 4, 8, 12, 16].map((at) => view.getFloat32(at, true));
  return { walkSpeed, runSpeed, acceleration, step, pushSpeed };
}

/** Position, velocity and heading of an avatar from `own` of an update. */
export function stateOf(own) {
  const view = new DataView(own.state.buffer, own.state.byteOffset, own.state.byteLength);
  const velocity = own.state.byteLength === 16 ? [view.getFloat32(0, true), view.getFloat32(4, true)] : [0, 0];
  const heading = own.state.byteLength === 16 ? view.getFloat32(12, true) : 0;
  return { x: own.position[0], y: own.position[1], z: own.position[2], vx: velocity[0], vy: velocity[1], heading };
}

/** The input in its bytes, as the server reads it. */
function wishOf(bytes, parameters) {
  const signed = (byte) => (byte << 24) >> 24;
  let x = signed(bytes[0]), y = signed(bytes[1]);
  const length = Math.hypot(x, y);
  if (length > 127) { x *= 127 / length; y *= 127 / length; }
  const speed = (bytes[4] & 1 ? parameters.runSpeed : parameters.walkSpeed) / 127;
  return { x: x * speed, y: y * speed, heading: (bytes[2] | (bytes[3] << 8)) * (2 * Math.PI / 65536) };
}

/** Radius in the plane of an avatar of this shape. */
export function radiusOf(shape) {
  if (shape?.kind === "box") return Math.min(shape.half[0], shape.half[1]);
  return shape?.radius > 0 ? shape.radius : usualRadius;
}

/** Contacts in the plane of a round avatar at x, y with what stands near it. Hulls and meshes are left to the server. */
export function contactsAt(x, y, radius, objects, shapes) {
  const contacts = [];
  for (const object of objects) {
    const shape = shapes.get(object.shape);
    const dx = x - object.position[0], dy = y - object.position[1];
    const contact = shape && contactWith(shape, object, dx, dy, radius);
    if (contact && contact.depth > 0) contacts.push({ ...contact, givesWay: object.category === nonActive });
  }
  return contacts;
}

function contactWith(shape, object, dx, dy, radius) {
  if (shape.kind === "sphere" || shape.kind === "capsule") {
    const length = Math.hypot(dx, dy);
    return length > 0 && { x: dx / length, y: dy / length, depth: shape.radius + radius - length };
  }
  if (shape.kind !== "box") return null;
  // In the axes of a box that is turned about z.
  const [, , qz, qw] = object.orientation;
  const cos = qw * qw - qz * qz, sin = 2 * qz * qw;
  const u = dx * cos + dy * sin, v = -dx * sin + dy * cos;
  const overU = Math.abs(u) - shape.half[0], overV = Math.abs(v) - shape.half[1];
  let nu = 0, nv = 0, distance;
  if (overU > 0 && overV > 0) {
    distance = Math.hypot(overU, overV);
    nu = (Math.sign(u) * overU) / distance;
    nv = (Math.sign(v) * overV) / distance;
  } else if (overU > overV) {
    distance = overU;
    nu = Math.sign(u);
  } else {
    distance = overV;
    nv = Math.sign(v);
  }
  return { x: nu * cos - nv * sin, y: nu * sin + nv * cos, depth: radius - distance };
}

/** Objects that an avatar at x, y can touch within a few steps. */
export function obstaclesNear(x, y, objects, radius = 6) {
  const near = [];
  for (const object of objects) {
    if (object.category !== fixed && object.category !== nonActive) continue;
    const dx = object.position[0] - x, dy = object.position[1] - y;
    if (dx * dx + dy * dy < radius * radius) near.push(object);
  }
  return near;
}

/** The contacts that the server reports, with normals that point to the avatar. */
export function contactsOf(contacts, objects) {
  const result = [];
  for (const { number, phase, normal, depth } of contacts) {
    if (phase === "end") continue;
    const length = Math.hypot(normal[0], normal[1]);
    if (length < leastPlaneLength) continue;
    const givesWay = objects.get(number)?.category === nonActive;
    result.push({ x: -normal[0] / length, y: -normal[1] / length, depth, givesWay });
  }
  return result;
}

/** One frame of an avatar, in place. `contacts` are those of the frame before. */
export function step(state, bytes, contacts, parameters, bounds) {
  const wish = wishOf(bytes, parameters);
  let dvx = wish.x - state.vx, dvy = wish.y - state.vy;
  const change = Math.hypot(dvx, dvy), most = parameters.acceleration * parameters.step;
  if (change > most) { dvx *= most / change; dvy *= most / change; }
  state.vx += dvx;
  state.vy += dvy;
  let pushX = 0, pushY = 0;
  for (const { x, y, depth, givesWay } of contacts) {
    const allowed = givesWay ? parameters.pushSpeed * Math.max(0, 1 - depth / pushDepth) : 0;
    const approach = state.vx * x + state.vy * y + allowed;
    if (approach < 0) { state.vx -= x * approach; state.vy -= y * approach; }
    const beyond = Math.max(0, depth - (givesWay ? pushDepth : slop)) * share;
    pushX += x * beyond;
    pushY += y * beyond;
  }
  const inside = (value, low, high) => Math.max(low, Math.min(high, value));
  state.x = inside(state.x + pushX + state.vx * parameters.step, bounds[0], bounds[3]);
  state.y = inside(state.y + pushY + state.vy * parameters.step, bounds[1], bounds[4]);
  state.heading = wish.heading;
}
