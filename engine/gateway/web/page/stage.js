import { AmbientLight, BufferGeometry, Color, DirectionalLight, Float32BufferAttribute, Fog, LineBasicMaterial,
  LineSegments, Mesh, MeshBasicMaterial, MeshLambertMaterial, PerspectiveCamera, PlaneGeometry, Raycaster, RingGeometry,
  Scene, Vector2, WebGLRenderer } from "three";

const cellOf = (side) => 10 ** Math.max(1, Math.floor(Math.log10(side / 20))); // metres
const nearSide = 300; // metres: in larger worlds the camera, the fog and the marks are larger too

/** The whole multiples of the cell from min to max, relative to the middle of the two. */
function linesBetween(min, max, cell) {
  const first = Math.ceil(min / cell) * cell - min, half = (max - min) / 2;
  return Array.from({ length: Math.floor((max - min - first) / cell) + 1 }, (_, index) => first + index * cell - half);
}
/** The grid on the ground, relative to the middle of the bounds. */
function gridOf([minX, minY, , maxX, maxY]) {
  const width = maxX - minX, height = maxY - minY, cell = cellOf(Math.max(width, height));
  const ends = [];
  for (const x of linesBetween(minX, maxX, cell)) ends.push(x, -height / 2, 0, x, height / 2, 0);
  for (const y of linesBetween(minY, maxY, cell)) ends.push(-width / 2, y, 0, width / 2, y, 0);
  return new BufferGeometry().setAttribute("position", new Float32BufferAttribute(ends, 3));
}

/** What is drawn: the camera, the lights and the ground. z is up. */
export class Stage {
  constructor(canvas) {
    this.canvas = canvas;
    this.scale = 1;
    this.renderer = new WebGLRenderer({ canvas, antialias: true, powerPreference: "high-performance" });
    this.scene = new Scene();
    this.camera = new PerspectiveCamera(45, 1, 0.1, 3000);
    this.camera.up.set(0, 0, 1);
    this.ambient = new AmbientLight(0xffffff, 1);
    this.sun = new DirectionalLight(0xffffff, 2);
    this.sun.position.set(-0.5, -0.8, 1.4);
    this.ground = new Mesh(new PlaneGeometry(1, 1), new MeshLambertMaterial());
    this.marker = new Mesh(new RingGeometry(0.5, 0.62, 40), new MeshBasicMaterial({ transparent: true, opacity: 0.9 }));
    this.marker.visible = false;
    this.grid = new LineSegments(new BufferGeometry(), new LineBasicMaterial());
    this.scene.add(this.ambient, this.sun, this.ground, this.grid, this.marker);
    this.scene.fog = new Fog(0xffffff, 80, 500);
    this.raycaster = new Raycaster();
    new ResizeObserver(() => this.resize()).observe(canvas);
    this.resize();
  }
  resize() {
    const { clientWidth: width, clientHeight: height } = this.canvas;
    this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
    this.renderer.setSize(width, height, false);
    this.camera.aspect = width / Math.max(1, height);
    this.camera.updateProjectionMatrix();
  }
  setColours(colours) {
    this.scene.background = new Color(colours.sky);
    this.scene.fog.color.set(colours.sky);
    this.ground.material.color.set(colours.ground);
    this.ambient.intensity = colours.ambient;
    this.sun.intensity = colours.light;
    this.grid.material.color.set(colours.grid);
    this.marker.material.color.set(colours.own);
  }
  setBounds(bounds) {
    this.scale = Math.max(1, Math.max(bounds[3] - bounds[0], bounds[4] - bounds[1]) / nearSide);
    Object.assign(this.camera, { near: 0.1 * this.scale, far: 3000 * this.scale });
    this.camera.updateProjectionMatrix();
    this.marker.scale.setScalar(this.scale);
    const [minX, minY, , maxX, maxY] = bounds;
    const width = maxX - minX, height = maxY - minY;
    this.ground.scale.set(width, height, 1);
    this.ground.position.set((minX + maxX) / 2, (minY + maxY) / 2, -0.02 * this.scale);
    this.grid.geometry.dispose();
    this.grid.geometry = gridOf(bounds);
    this.grid.position.set(this.ground.position.x, this.ground.position.y, 0);
  }
  /** A ring on the ground around the selected object. */
  mark(place) {
    this.marker.visible = place !== null;
    if (place !== null) this.marker.position.set(place[0], place[1], 0.04 * this.scale);
  }
  /** Looks at a point from a direction: yaw and pitch in radians, distance in metres. */
  look([x, y, z], yaw, pitch, distance) {
    const flat = Math.cos(pitch) * distance;
    this.camera.position.set(x - Math.cos(yaw) * flat, y - Math.sin(yaw) * flat, z + Math.sin(pitch) * distance);
    this.camera.lookAt(x, y, z);
    this.scene.fog.near = distance + 60 * this.scale;
    this.scene.fog.far = distance * 3 + 400 * this.scale;
  }
  /** A ray through a point of the window, in pixels. */
  rayAt(x, y) {
    const { clientWidth, clientHeight } = this.canvas;
    this.raycaster.setFromCamera(new Vector2((x / clientWidth) * 2 - 1, 1 - (y / clientHeight) * 2), this.camera);
    return this.raycaster;
  }
  render() { this.renderer.render(this.scene, this.camera); }
  get drawCalls() { return this.renderer.info.render.calls; }
}
