// Keys, mouse and touch become a wish to walk and a direction to look.

const directions = { KeyW: [1, 0], ArrowUp: [1, 0], KeyS: [-1, 0], ArrowDown: [-1, 0], KeyA: [0, 1], ArrowLeft: [0, 1],
  KeyD: [0, -1], ArrowRight: [0, -1] };
const clickPixels = 5; // a shorter drag is a click
const stickPixels = 40; // full speed

export class Controls {
  constructor(canvas, stick, knob) {
    this.keys = new Set();
    this.stickAt = [0, 0];
    this.yaw = Math.PI / 2;
    this.pitch = 0.45;
    this.distance = 12;
    this.scale = 1; // of the stage
    this.onClick = () => {};
    this.listenToKeys(canvas);
    this.listenToPointer(canvas);
    this.listenToStick(stick, knob);
    canvas.addEventListener("wheel", (event) => {
      event.preventDefault();
      this.zoom(Math.exp(event.deltaY * 0.001));
    }, { passive: false });
  }
  zoom(factor) { this.distance = Math.max(3 * this.scale, Math.min(900 * this.scale, this.distance * factor)); }

  listenToKeys() {
    const isTyping = (event) => event.target instanceof HTMLInputElement && event.target.type !== "range";
    addEventListener("keydown", (event) => {
      if (isTyping(event) || event.ctrlKey || event.metaKey || event.altKey) return;
      if (!(event.code in directions) && !event.code.startsWith("Shift")) return;
      if (event.target instanceof HTMLInputElement) event.target.blur();
      event.preventDefault();
      this.keys.add(event.code);
    });
    addEventListener("keyup", (event) => this.keys.delete(event.code));
    addEventListener("blur", () => this.keys.clear());
  }
  listenToPointer(canvas) {
    let drag = null;
    canvas.addEventListener("pointerdown", (event) => {
      canvas.focus({ preventScroll: true });
      canvas.setPointerCapture(event.pointerId);
      drag = { id: event.pointerId, x: event.clientX, y: event.clientY, moved: 0 };
    });
    canvas.addEventListener("pointermove", (event) => {
      if (drag === null || drag.id !== event.pointerId) return;
      const dx = event.clientX - drag.x, dy = event.clientY - drag.y;
      Object.assign(drag, { x: event.clientX, y: event.clientY, moved: drag.moved + Math.abs(dx) + Math.abs(dy) });
      if (drag.moved < clickPixels) return;
      this.yaw -= dx * 0.006;
      this.pitch = Math.max(0.08, Math.min(1.52, this.pitch + dy * 0.005));
    });
    const end = (event) => {
      if (drag?.id === event.pointerId && drag.moved < clickPixels && event.type === "pointerup") {
        this.onClick(event.clientX, event.clientY);
      }
      drag = null;
    };
    canvas.addEventListener("pointerup", end);
    canvas.addEventListener("pointercancel", end);
  }
  listenToStick(stick, knob) {
    const move = (event) => {
      const box = stick.getBoundingClientRect();
      let x = event.clientX - (box.left + box.width / 2), y = event.clientY - (box.top + box.height / 2);
      const length = Math.hypot(x, y), scale = length > stickPixels ? stickPixels / length : 1;
      x *= scale;
      y *= scale;
      knob.style.transform = `translate(${x}px, ${y}px)`;
      this.stickAt = [-y / stickPixels, -x / stickPixels];
    };
    const release = () => {
      knob.style.transform = "";
      this.stickAt = [0, 0];
    };
    stick.addEventListener("pointerdown", (event) => { stick.setPointerCapture(event.pointerId); move(event); });
    stick.addEventListener("pointermove", (event) => { if (stick.hasPointerCapture(event.pointerId)) move(event); });
    stick.addEventListener("pointerup", release);
    stick.addEventListener("pointercancel", release);
  }

  /** Forward and left, -1 to 1 each, relative to where the camera looks. */
  get direction() {
    let [forward, left] = this.stickAt;
    for (const key of this.keys) {
      const [f, l] = directions[key] ?? [0, 0];
      forward += f;
      left += l;
    }
    const length = Math.hypot(forward, left);
    return length > 1 ? [forward / length, left / length] : [forward, left];
  }
  /** What the player wants, in the axes of the world. An avatar that stands keeps its heading. */
  wish(heading) {
    const [forward, left] = this.direction;
    const cos = Math.cos(this.yaw), sin = Math.sin(this.yaw);
    const x = forward * cos - left * sin, y = forward * sin + left * cos;
    const run = this.keys.has("ShiftLeft") || this.keys.has("ShiftRight");
    return { x, y, heading: x === 0 && y === 0 ? heading : Math.atan2(y, x), run };
  }
}
