import { BoxGeometry, BufferAttribute, BufferGeometry, CapsuleGeometry, IcosahedronGeometry, SphereGeometry,
  Vector3 } from "three";
import { ConvexGeometry } from "three/examples/jsm/geometries/ConvexGeometry.js";

const ownGeometries = 10; // shapes that are drawn exactly; others are drawn as balls, boxes or their extent

/** Chooses for each shape what draws it: a geometry that shapes may share, and the scale of this shape. */
export class ShapeGeometries {
  constructor() {
    this.exact = 0;
    this.kinds = new Map(); // shape number → { key, scale }
    this.geometries = new Map([
      ["ball", new SphereGeometry(1, 16, 10)], ["box", new BoxGeometry(2, 2, 2)], ["stone", new IcosahedronGeometry(1, 1)],
    ]);
  }
  /** { key, scale } of a shape. */
  of(shape) {
    let kind = this.kinds.get(shape.shape);
    if (kind === undefined) {
      kind = this.choose(shape);
      this.kinds.set(shape.shape, kind);
    }
    return kind;
  }
  geometry(key) { return this.geometries.get(key); }

  choose(shape) {
    switch (shape.kind) {
      case "sphere": return { key: "ball", scale: [shape.radius, shape.radius, shape.radius] };
      case "box": return { key: "box", scale: shape.half };
      case "capsule": return this.capsule(shape);
      case "hull": case "mesh": return this.points(shape);
      default: return { key: "ball", scale: Array(3).fill(shape.radius ?? 0.5) };
    }
  }
  capsule({ radius, halfLength }) {
    const key = `capsule ${radius} ${halfLength}`;
    if (!this.geometries.has(key)) {
      if (++this.exact > ownGeometries) return { key: "ball", scale: [radius, radius, radius + halfLength] };
      this.geometries.set(key, new CapsuleGeometry(radius, 2 * halfLength, 4, 12).rotateX(Math.PI / 2));
    }
    return { key, scale: [1, 1, 1] };
  }
  points({ shape, kind, points, triangles }) {
    if (++this.exact > ownGeometries) return { key: "stone", scale: extentOf(points) };
    const key = `shape ${shape}`;
    this.geometries.set(key, kind === "hull" ? hullGeometry(points) : meshGeometry(points, triangles));
    return { key, scale: [1, 1, 1] };
  }
}

function extentOf(points) {
  const extent = [0.01, 0.01, 0.01];
  points.forEach((value, index) => { extent[index % 3] = Math.max(extent[index % 3], Math.abs(value)); });
  return extent;
}
function hullGeometry(points) {
  const corners = [];
  for (let at = 0; at < points.length; at += 3) corners.push(new Vector3(points[at], points[at + 1], points[at + 2]));
  return new ConvexGeometry(corners);
}
function meshGeometry(points, triangles) {
  const geometry = new BufferGeometry();
  geometry.setAttribute("position", new BufferAttribute(points, 3));
  geometry.setIndex(new BufferAttribute(triangles, 1));
  const flat = geometry.toNonIndexed();
  flat.computeVertexNormals();
  return flat;
}
