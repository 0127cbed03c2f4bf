import { nodeColour } from "./theme.js";

const kept = 120; // values of a line
const leastShown = 20; // a shorter line does not fill the width
const graphs = {
  load: { title: "work of each node", text: (values) => `up to ${Math.max(...values).toFixed(2)} ms` },
  counts: { title: "pairs, contacts", text: ([pairs, contacts]) => `${pairs}, ${contacts}` },
  sent: { title: "received by this user", text: ([value]) => `${value.toFixed(1)} kB/s` },
};

/** Lines over time, each drawn in a small canvas. */
export class Charts {
  constructor(panel, theme) {
    this.panel = panel;
    this.theme = theme;
    this.graphs = new Map();
  }
  show(name, isShown) {
    if (isShown && !this.graphs.has(name)) this.graphs.set(name, this.make(graphs[name]));
    if (this.graphs.has(name)) this.graphs.get(name).figure.hidden = !isShown;
    this.panel.hidden = Array.from(this.graphs.values()).every(({ figure }) => figure.hidden);
    if (isShown) this.draw(name);
  }
  make({ title }) {
    const figure = document.createElement("figure");
    const caption = document.createElement("figcaption");
    const name = document.createElement("span"), value = document.createElement("span");
    const canvas = document.createElement("canvas");
    name.textContent = title;
    caption.append(name, value);
    figure.append(caption, canvas);
    this.panel.append(figure);
    return { figure, canvas, value, lines: new Map() };
  }
  /** Adds a value to lines of a graph: [[name, value, colour], ...]. Lines without a new value end. */
  add(name, values) {
    if (!this.graphs.has(name)) {
      this.graphs.set(name, this.make(graphs[name]));
      this.graphs.get(name).figure.hidden = true;
    }
    const { lines, value } = this.graphs.get(name);
    for (const [key, line] of lines) if (!values.some(([other]) => other === key)) line.values.push(NaN);
    for (const [key, number, colour] of values) {
      if (!lines.has(key)) {
        const length = Math.max(0, ...Array.from(lines.values(), (line) => line.values.length - 1));
        lines.set(key, { values: Array(length).fill(NaN) });
      }
      Object.assign(lines.get(key), { colour });
      lines.get(key).values.push(number);
    }
    for (const [key, line] of lines) {
      while (line.values.length > kept) line.values.shift();
      if (line.values.every(Number.isNaN)) lines.delete(key);
    }
    value.textContent = values.length > 0 ? graphs[name].text(values.map(([, number]) => number)) : "";
    this.draw(name);
  }
  draw(name) {
    const { figure, canvas, lines } = this.graphs.get(name);
    if (figure.hidden || this.panel.hidden) return;
    const width = (canvas.width = canvas.clientWidth * devicePixelRatio);
    const height = (canvas.height = canvas.clientHeight * devicePixelRatio);
    const context = canvas.getContext("2d");
    const largest = Math.max(1e-9, ...Array.from(lines.values(), ({ values }) => Math.max(...values.filter((v) => v >= 0))));
    const { isDark } = this.theme;
    context.strokeStyle = isDark ? "rgb(220 226 236 / 0.16)" : "rgb(40 44 52 / 0.14)";
    context.beginPath();
    context.moveTo(0, height - 1);
    context.lineTo(width, height - 1);
    context.stroke();
    const shown = Math.max(leastShown, ...Array.from(lines.values(), ({ values }) => values.length));
    context.lineWidth = 1.6 * devicePixelRatio;
    for (const { values, colour } of lines.values()) {
      context.strokeStyle = typeof colour === "number" ? nodeColour(colour, isDark) : colour;
      context.beginPath();
      let isDown = false;
      values.forEach((value, index) => {
        const x = (index / (shown - 1)) * width, y = height - 2 - (value / largest) * (height - 8);
        if (Number.isNaN(value)) isDown = false;
        else if (isDown) context.lineTo(x, y);
        else { context.moveTo(x, y); isDown = true; }
      });
      context.stroke();
    }
  }
}
