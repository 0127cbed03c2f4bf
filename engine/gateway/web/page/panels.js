import { nodeColour } from "./theme.js";

const categories = ["avatar", "active", "non-active", "static"];
const element = (id) => document.getElementById(id);
const lostShown_ms = 8000;

/** The figures at the top, and messages. */
export class Figures {
  show(statistics) {
    element("figure-frame").textContent = statistics.frame < 0 ? "–" : statistics.frame.toLocaleString("en");
    element("figure-objects").textContent = statistics.objects.toLocaleString("en");
    element("figure-bytes").textContent = `${(statistics.bytesPerSecond / 1000).toFixed(1)} kB/s`;
    element("figure-ping").textContent = statistics.ping_ms > 0 ? `${Math.round(statistics.ping_ms)} ms` : "–";
  }
  connection(text, isBad) {
    element("connection").textContent = text;
    element("connection").classList.toggle("bad", isBad);
  }
  notice(text) {
    const notice = element("notice");
    notice.textContent = text;
    notice.hidden = false;
    clearTimeout(this.timer);
    this.timer = setTimeout(() => { notice.hidden = true; }, 5000);
  }
}

/** What the colours mean, for spectators. */
export class Legend {
  constructor(colours) {
    this.colours = colours; // () → those of the theme
    this.shown = "";
  }
  show(objects, touching) {
    const present = [...new Set(Array.from(objects.values(), (object) => object.category))].sort();
    const { categories: hues, flash } = this.colours();
    const rows = present.map((category) => [hues[category], present.length === 1 ? "objects" : categories[category]]);
    const count = (value) => value.toLocaleString("en");
    rows.push([flash, touching.label === "" ? `touching: ${count(touching.pairs.length)} pairs`
      : `${touching.label}: ${count(touching.pairs.length)} now, ${count(touching.seen)} seen`]);
    const shown = JSON.stringify(rows);
    if (shown === this.shown) return;
    this.shown = shown;
    element("legend").replaceChildren(...rows.map(([colour, text]) => {
      const row = document.createElement("li"), swatch = document.createElement("span");
      swatch.className = "swatch";
      swatch.style.background = `#${colour.toString(16).padStart(6, "0")}`;
      row.append(swatch, text);
      return row;
    }));
    element("legend").hidden = false;
  }
}

/** The state of the object that was clicked. */
export class Inspector {
  constructor(onClose) {
    this.number = null;
    element("object-close").addEventListener("click", () => { this.close(); onClose(); });
  }
  close() {
    this.number = null;
    element("object").hidden = true;
  }
  show(object, shapes) {
    this.number = object.number;
    const place = object.position?.map((value) => value.toFixed(2)).join(", ");
    const rows = object.category === undefined ? { number: object.number, state: "is gone" } : {
      number: `${object.number}, generation ${object.generation}`,
      category: typeof object.category === "number" ? categories[object.category] : object.category,
      shape: `${object.shape} (${shapes.get(object.shape)?.kind ?? "unknown"})`,
      user: object.user >= 0 ? object.user : "none", node: object.node ?? "none", position: `${place} m`,
      touches: object.contacts?.length ? object.contacts.join(", ") : "nothing", state: object.state || "none" };
    element("object-fields").replaceChildren(...Object.entries(rows).flatMap(([name, value]) => {
      const term = document.createElement("dt"), text = document.createElement("dd");
      term.textContent = name;
      text.textContent = String(value);
      return [term, text];
    }));
    element("object").hidden = false;
  }
}

/** What an operator sees and does. */
export class OperatorPanel {
  constructor(client, theme) {
    this.client = client;
    this.theme = theme;
    this.lost = new Map(); // id → time
    this.count = 0;
    element("add-node").addEventListener("click", () => client.command("nodes", this.count + 1));
    element("remove-node").addEventListener("click", () => client.command("nodes", Math.max(0, this.count - 1)));
    element("set-robots").addEventListener("click", () => client.command("robots", Number(element("robots").value) || 0));
    element("operator").hidden = false;
  }
  show(status, now) {
    this.count = status.nodes.length;
    for (const id of status.lost ?? []) this.lost.set(id, now);
    for (const [id, time] of this.lost) if (now - time > lostShown_ms) this.lost.delete(id);
    element("digest").textContent = status.digest ?? "";
    const alive = status.nodes.map((node) => this.row(node.id, `${node.busy_ms.toFixed(2)} ms`,
      Math.round(node.pairs).toLocaleString("en"), true));
    const gone = Array.from(this.lost.keys(), (id) => this.row(id, "lost", "", false));
    element("nodes").replaceChildren(...alive, ...gone);
  }
  row(id, busy, pairs, isAlive) {
    const row = document.createElement("tr");
    row.className = isAlive ? "" : "lost";
    const swatch = document.createElement("span");
    swatch.className = "swatch";
    swatch.style.background = nodeColour(id, this.theme.isDark);
    const cells = [String(id), busy, pairs, ""].map((text) => {
      const cell = document.createElement("td");
      cell.textContent = text;
      return cell;
    });
    cells[0].prepend(swatch);
    if (isAlive) {
      const kill = document.createElement("button");
      Object.assign(kill, { type: "button", textContent: "Kill" });
      kill.dataset.node = id;
      kill.addEventListener("click", () => this.client.command("kill", id));
      cells[3].append(kill);
    }
    row.append(...cells);
    return row;
  }
}

/** Pauses, and shows a moment of the last minute. `time` is a server time in ms, or null: now. */
export class Timeline {
  constructor(history) {
    this.history = history;
    this.time = null;
    element("pause").addEventListener("click", () => this.toggle());
    element("resume").addEventListener("click", () => this.toggle());
    element("moment").addEventListener("input", () => {
      const range = history()?.range;
      if (!range || this.time === null) return;
      this.time = this.range[0] + Number(element("moment").value) * (this.range[1] - this.range[0]);
      this.label();
    });
  }
  toggle() {
    this.range = this.history()?.range ?? null;
    this.time = this.time === null && this.range !== null ? this.range[1] : null;
    const isPaused = this.time !== null;
    element("timeline").hidden = !isPaused;
    element("pause").setAttribute("aria-pressed", String(isPaused));
    element("moment").value = 1;
    if (isPaused) this.label();
  }
  label() { element("moment-text").textContent = `−${((this.range[1] - this.time) / 1000).toFixed(1)} s`; }
}
