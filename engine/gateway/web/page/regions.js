import { Color, DataTexture, Mesh, MeshBasicMaterial, NearestFilter, PlaneGeometry, SRGBColorSpace } from "three";

import { nodeColour } from "./theme.js";

/** The regions of the CD nodes as colours on the ground. */
export class Regions {
  constructor(stage) {
    this.stage = stage;
    this.map = null;
    this.mesh = new Mesh(new PlaneGeometry(1, 1), new MeshBasicMaterial({ transparent: true, opacity: 0.34,
      depthWrite: false }));
    this.mesh.visible = false;
    stage.scene.add(this.mesh);
  }
  setMap(map, isDark) {
    this.map = map;
    this.draw(isDark);
  }
  draw(isDark) {
    if (this.map === null) return;
    const { columns, rows, min, max, nodes } = this.map;
    const texels = new Uint8Array(columns * rows * 4);
    const colours = new Map();
    nodes.forEach((id, index) => {
      if (!colours.has(id)) colours.set(id, new Color(nodeColour(id, isDark)).getHex(SRGBColorSpace));
      const hex = colours.get(id);
      texels.set([hex >> 16, (hex >> 8) & 255, hex & 255, 255], index * 4);
    });
    this.mesh.material.map?.dispose();
    const texture = new DataTexture(texels, columns, rows);
    texture.colorSpace = SRGBColorSpace;
    texture.magFilter = texture.minFilter = NearestFilter;
    texture.needsUpdate = true;
    this.mesh.material.map = texture;
    this.mesh.material.needsUpdate = true;
    this.mesh.scale.set(max[0] - min[0], max[1] - min[1], 1);
    this.mesh.position.set((min[0] + max[0]) / 2, (min[1] + max[1]) / 2, -0.005 * this.stage.scale);
  }
  nodeAt(x, y) {
    const { columns, rows, min, max, nodes } = this.map;
    const inside = (value, count) => Math.max(0, Math.min(count - 1, Math.floor(value * count)));
    const column = inside((x - min[0]) / (max[0] - min[0]), columns);
    return nodes[inside((y - min[1]) / (max[1] - min[1]), rows) * columns + column];
  }
  /** Whether an object of this extent touches more than one region, so that several nodes hold it. */
  isGhost = (x, y, scale) => {
    if (this.map === null) return false;
    const reach = Math.max(scale[0], scale[1]);
    const node = this.nodeAt(x - reach, y - reach);
    return node !== this.nodeAt(x + reach, y - reach) || node !== this.nodeAt(x - reach, y + reach) ||
      node !== this.nodeAt(x + reach, y + reach);
  };
}
