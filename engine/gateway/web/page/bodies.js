import { Color, DynamicDrawUsage, InstancedBufferAttribute, InstancedMesh, MeshLambertMaterial } from "three";

import { ShapeGeometries } from "./shape-geometry.js";

const fixed = 3; // category
const firstCapacity = 256;
const flash_ms = 450;
const isFlat = (key) => key !== "ball" && !key.startsWith("capsule");

/**
 * All objects, one instanced mesh for each geometry. Each frame visits every object once: it gets an instance, moves it,
 * and instances of objects that were not visited are removed.
 */
export class Bodies {
  constructor(stage) {
    this.stage = stage;
    this.shapes = new ShapeGeometries();
    this.groups = new Map(); // key of a geometry → { mesh, slots }
    this.slots = new Map(); // number of an object → { group, index, ... }
    this.flashes = new Map(); // number → time
    this.round = 0;
    this.origin = [0, 0];
  }
  setColours(colours) {
    this.colours = { categories: colours.categories.map((hex) => new Color(hex)), own: new Color(colours.own),
      flash: new Color(colours.flash), ghost: new Color(colours.ghost) };
    for (const slot of this.slots.values()) slot.colour = null;
  }
  /** An object that begins to touch another changes its colour for a moment. */
  flash(number, now) { this.flashes.set(number, now); }

  /** `marked`: numbers of the objects that have the colour of a contact all the time. */
  begin(now, shapes, { own, isGhost, marked }) {
    ++this.round;
    this.now = now;
    this.known = shapes;
    this.own = own;
    this.isGhost = isGhost;
    this.marked = marked;
    for (const [number, time] of this.flashes) if (now - time > flash_ms) this.flashes.delete(number);
  }
  visit = (object, x, y, z, qx, qy, qz, qw) => {
    let slot = this.slots.get(object.number);
    if (slot !== undefined && (slot.shape !== object.shape || slot.generation !== object.generation)) {
      this.remove(slot);
      slot = undefined;
    }
    slot ??= this.add(object);
    if (slot === undefined) return; // its shape is not known yet
    slot.round = this.round;
    if (slot.isPlaced && object.category === fixed) {
      this.paint(slot, object, x, y);
      return;
    }
    slot.isPlaced = true;
    this.place(slot, x, y, z, qx, qy, qz, qw);
    this.paint(slot, object, x, y);
  };
  end() {
    for (const slot of this.slots.values()) if (slot.round !== this.round) this.remove(slot);
    for (const { mesh, slots } of this.groups.values()) {
      mesh.count = slots.length;
      mesh.visible = slots.length > 0;
      mesh.instanceMatrix.needsUpdate = true;
    }
  }

  add(object) {
    const shape = this.known.get(object.shape);
    if (shape === undefined || shape.kind === "none") return undefined;
    const { key, scale } = this.shapes.of(shape);
    const group = this.groups.get(key) ?? this.addGroup(key);
    if (group.slots.length === group.mesh.instanceMatrix.count) this.grow(group);
    const slot = { number: object.number, generation: object.generation, shape: object.shape, group, scale,
      index: group.slots.length, colour: null, isPlaced: false, round: 0 };
    group.slots.push(slot);
    this.slots.set(object.number, slot);
    return slot;
  }
  addGroup(key) {
    const group = { key, slots: [], mesh: this.makeMesh(key, firstCapacity) };
    this.groups.set(key, group);
    return group;
  }
  makeMesh(key, capacity) {
    const mesh = new InstancedMesh(this.shapes.geometry(key), new MeshLambertMaterial({ flatShading: isFlat(key) }),
      capacity);
    mesh.instanceMatrix.setUsage(DynamicDrawUsage);
    mesh.instanceColor = new InstancedBufferAttribute(new Float32Array(capacity * 3), 3);
    mesh.frustumCulled = false;
    mesh.userData.key = key;
    this.stage.scene.add(mesh);
    return mesh;
  }
  grow(group) {
    const old = group.mesh;
    group.mesh = this.makeMesh(group.key, old.instanceMatrix.count * 2);
    group.mesh.instanceMatrix.array.set(old.instanceMatrix.array);
    group.mesh.instanceColor.array.set(old.instanceColor.array);
    this.stage.scene.remove(old);
    old.material.dispose();
    old.dispose();
  }
  /** The last instance of the group takes the place of the removed one. */
  remove(slot) {
    const { slots, mesh } = slot.group;
    const last = slots.pop();
    if (last !== slot) {
      mesh.instanceMatrix.array.copyWithin(slot.index * 16, last.index * 16, last.index * 16 + 16);
      mesh.instanceColor.array.copyWithin(slot.index * 3, last.index * 3, last.index * 3 + 3);
      mesh.instanceColor.needsUpdate = true;
      last.index = slot.index;
      slots[slot.index] = last;
    }
    this.slots.delete(slot.number);
  }

  /** Writes the matrix of a pose and a scale. */
  place({ group, index, scale }, x, y, z, qx, qy, qz, qw) {
    const m = group.mesh.instanceMatrix.array, at = index * 16;
    const x2 = qx + qx, y2 = qy + qy, z2 = qz + qz;
    const xx = qx * x2, xy = qx * y2, xz = qx * z2, yy = qy * y2, yz = qy * z2, zz = qz * z2;
    const wx = qw * x2, wy = qw * y2, wz = qw * z2;
    const [sx, sy, sz] = scale;
    m[at] = (1 - (yy + zz)) * sx; m[at + 1] = (xy + wz) * sx; m[at + 2] = (xz - wy) * sx; m[at + 3] = 0;
    m[at + 4] = (xy - wz) * sy; m[at + 5] = (1 - (xx + zz)) * sy; m[at + 6] = (yz + wx) * sy; m[at + 7] = 0;
    m[at + 8] = (xz + wy) * sz; m[at + 9] = (yz - wx) * sz; m[at + 10] = (1 - (xx + yy)) * sz; m[at + 11] = 0;
    m[at + 12] = x - this.origin[0]; m[at + 13] = y - this.origin[1]; m[at + 14] = z; m[at + 15] = 1;
  }
  paint(slot, object, x, y) {
    const { own, flash, ghost, categories } = this.colours;
    let colour = object.number === this.own ? own : categories[object.category] ?? own;
    if (this.isGhost !== null && this.isGhost(x, y, slot.scale)) colour = ghost;
    if (this.marked.has(object.number) || this.flashes.has(object.number)) colour = flash;
    if (slot.colour === colour) return;
    slot.colour = colour;
    colour.toArray(slot.group.mesh.instanceColor.array, slot.index * 3);
    slot.group.mesh.instanceColor.needsUpdate = true;
  }

  /** The number of the object at a point of the canvas, or null. */
  pick(raycaster) {
    const meshes = Array.from(this.groups.values(), ({ mesh }) => mesh);
    for (const mesh of meshes) mesh.boundingSphere = null;
    const [hit] = raycaster.intersectObjects(meshes, false);
    if (hit === undefined) return null;
    return this.groups.get(hit.object.userData.key).slots[hit.instanceId]?.number ?? null;
  }
}
