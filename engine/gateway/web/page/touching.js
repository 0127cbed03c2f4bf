import { BufferAttribute, BufferGeometry, DynamicDrawUsage, LineBasicMaterial, LineSegments } from "three";

const firstCapacity = 64; // pairs
const shownFor_ms = 1500; // a contact of one frame is seen too
const most = 8192; // pairs that wait to be drawn

/**
 * The pairs that touch each other. If contacts have a meaning of their own in this world, such as "loss of separation",
 * the objects are marked, with a line from one to the other.
 */
export class Touching {
  constructor(stage) {
    this.label = ""; // what a contact means; empty: nothing particular
    this.pairs = []; // now
    this.seen = 0; // contacts that began since the page was opened
    this.shown = new Map(); // key of a pair → { pair, until, isDrawn }
    this.marked = new Set(); // numbers of the objects of the shown pairs
    this.places = new Map(); // number of such an object → its place in this frame
    this.lines = new LineSegments(new BufferGeometry(), new LineBasicMaterial());
    this.lines.frustumCulled = false;
    this.lines.visible = false;
    this.reserve(firstCapacity);
    stage.scene.add(this.lines);
  }
  setColours(colours) { this.lines.material.color.set(colours.flash); }
  reserve(pairs) {
    const places = new BufferAttribute(new Float32Array(pairs * 6), 3);
    places.setUsage(DynamicDrawUsage);
    this.lines.geometry.dispose();
    this.lines.geometry.setAttribute("position", places);
    this.capacity = pairs;
  }

  /** Sets the pairs of an update or of a past moment. Returns those that did not touch in the call before. */
  set(pairs, now) {
    if (pairs === this.pairs) return [];
    const before = new Set(this.pairs.map(String));
    const begun = pairs.filter((pair) => !before.has(String(pair)));
    this.pairs = pairs;
    this.seen += begun.length;
    this.show(now);
    this.expire(now);
    return begun;
  }
  show(now) {
    if (this.label === "") return;
    for (const pair of this.pairs) {
      const key = String(pair), isDrawn = this.shown.get(key)?.isDrawn ?? false;
      this.shown.set(key, { pair, until: now + shownFor_ms, isDrawn });
    }
  }
  /** Removes pairs whose time is over, if they were drawn. A hidden page draws nothing: then up to a limit. */
  expire(now) {
    const isFull = this.shown.size > most;
    for (const [key, { until, isDrawn }] of this.shown) if (until < now && (isDrawn || isFull)) this.shown.delete(key);
  }
  /** Before a frame is drawn. Pairs of earlier updates that no frame has drawn yet are shown too. */
  begin(now) {
    this.places.clear();
    if (this.label === "") return;
    this.show(now);
    this.expire(now);
    for (const each of this.shown.values()) each.isDrawn = true;
    this.marked = new Set(Array.from(this.shown.values(), ({ pair }) => pair).flat());
  }
  visit(number, x, y, z) { if (this.marked.has(number)) this.places.set(number, [x, y, z]); }
  end() {
    if (this.shown.size > this.capacity) this.reserve(this.shown.size * 2);
    const places = this.lines.geometry.getAttribute("position");
    let ends = 0;
    for (const { pair } of this.shown.values()) {
      const from = this.places.get(pair[0]), to = this.places.get(pair[1]);
      if (from === undefined || to === undefined) continue;
      places.setXYZ(ends++, ...from);
      places.setXYZ(ends++, ...to);
    }
    places.needsUpdate = ends > 0;
    this.lines.geometry.setDrawRange(0, ends);
    this.lines.visible = ends > 0;
  }
}
