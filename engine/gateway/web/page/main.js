import { Client } from "../client/client.js";
import { Bodies } from "./bodies.js";
import { Charts } from "./charts.js";
import { Controls } from "./controls.js";
import { Figures, Inspector, Legend, OperatorPanel, Timeline } from "./panels.js";
import { Regions } from "./regions.js";
import { Stage } from "./stage.js";
import { Theme } from "./theme.js";
import { Touching } from "./touching.js";

const historyBytes = 64 << 20;
const fastest = 50; // m/s on a square of the stage's usual size
const viewShare = 2.2; // a spectator sees this many times the camera's distance
const eyeHeight = 0.6; // metres above the middle of the avatar

const element = (id) => document.getElementById(id);
const isCalm = matchMedia("(prefers-reduced-motion: reduce)").matches;

/** Tokens are in the fragment, which browsers do not send: #token=... of this page, #operate=... of the operator's panel. */
const fragment = new URLSearchParams(location.hash.slice(1));
const token = fragment.get("token") ?? "";
function roleOf(jwt) {
  try {
    return JSON.parse(atob(jwt.split(".")[1].replaceAll("-", "+").replaceAll("_", "/"))).role;
  } catch {
    return undefined;
  }
}
const tokenRole = roleOf(token);
const isWatching = new URLSearchParams(location.search).has("watch") || tokenRole === "watch" || tokenRole === "operate";

const client = new Client(location.origin, { path: isWatching ? "/watch" : "/play", token, historyBytes });
const figures = new Figures();
const stage = new Stage(element("stage"));
const bodies = new Bodies(stage);
const regions = new Regions(stage);
const touching = new Touching(stage);
const controls = new Controls(element("stage"), element("stick"), element("knob"));
const theme = new Theme(document.documentElement, ({ colours, isDark }) => {
  stage.setColours(colours);
  bodies.setColours(colours);
  touching.setColours(colours);
  regions.draw(isDark);
  element("theme").textContent = isDark ? "Light" : "Dark";
});
const charts = new Charts(element("charts"), theme);
const legend = new Legend(() => theme.colours);
const timeline = new Timeline(() => client.history);
const inspector = new Inspector(() => stage.mark(null));
const layers = { regions: false, ghosts: false, load: false, counts: false, sent: false };

const centre = [0, 0, 0]; // what the camera looks at
const frameTimes = [];
let isAbove = false, monitor = null, operator = null, view = null, monitorStatus = null;

/** A second connection that receives the status of the nodes, which players do not. */
function watchNodes() {
  if (monitor !== null || isWatching) return;
  monitor = new Client(location.origin, { path: "/watch", token: fragment.get("operate") ?? "" });
  monitor.addEventListener("open", ({ detail }) => {
    monitor.setView([0, 0, 0], 0);
    begin(detail, monitor);
  });
  monitor.addEventListener("status", ({ detail }) => showStatus(detail));
  monitor.addEventListener("notice", ({ detail }) => figures.notice(detail));
  monitor.addEventListener("close", ({ detail }) => {
    if (detail.isFinal) figures.notice("The work of the nodes needs a token with the role watch or operate.");
  });
  monitor.connect();
}
function begin({ role }, connection) {
  if (role === "operate") operator ??= new OperatorPanel(connection, theme);
}
function showStatus(status) {
  monitorStatus = status;
  touching.label = status.contact_label ?? "";
  if (status.regions) regions.setMap(status.regions, theme.isDark);
  charts.add("load", status.nodes.map(({ id, busy_ms }) => [id, busy_ms, id]));
  charts.add("counts", [["pairs", status.pairs, theme.isDark ? "#6ea8e6" : "#2f6fb3"],
    ["contacts", status.contacts, theme.isDark ? "#f08a55" : "#c9551f"]]);
  operator?.show(status, performance.now());
}

client.addEventListener("open", ({ detail }) => {
  stage.setBounds(detail.bounds);
  controls.scale = stage.scale;
  client.setFastest(fastest * stage.scale);
  const who = { play: `player ${detail.user}`, watch: "spectator", operate: "operator" }[detail.role];
  figures.connection(`${detail.world}, ${who}`, false);
  begin(detail, client);
  if (isWatching) startWatching(detail.bounds);
});
client.addEventListener("close", ({ detail }) => {
  // Spectators may look at a world in which this visitor may not play.
  if (detail.code === 4403 && !isWatching) return location.replace(`?watch${location.hash}`);
  const reason = detail.reason === "" ? "the connection ended" : detail.reason;
  figures.connection(detail.isFinal ? reason : `${reason}; connecting again`, true);
});
client.addEventListener("status", ({ detail }) => showStatus(detail));
client.addEventListener("notice", ({ detail }) => figures.notice(detail));
client.addEventListener("described", ({ detail }) => inspector.show(detail, client.shapes));
client.addEventListener("update", ({ detail }) => {
  const begun = touching.set(timeline.time === null ? detail.touching : touching.pairs, performance.now());
  if (isCalm) return;
  for (const number of begun.flat()) bodies.flash(number, performance.now());
  for (const { number, phase, age } of detail.contacts) {
    if (phase === "begin" || (phase === "persist" && age < 2)) bodies.flash(number, performance.now());
  }
});
setInterval(() => {
  figures.show(client.statistics);
  if (isWatching) legend.show(client.objects, touching);
  charts.add("sent", [["bytes", client.statistics.bytesPerSecond / 1000, theme.isDark ? "#5fb5a5" : "#3d8a7c"]]);
  if (inspector.number !== null && timeline.time === null) client.describe(inspector.number);
}, 500);

function startWatching(bounds) {
  if (view === null) {
    centre[0] = (bounds[0] + bounds[3]) / 2;
    centre[1] = (bounds[1] + bounds[4]) / 2;
    // All of a large world, or a good part of a small one.
    controls.distance = stage.scale > 1 ? 320 * stage.scale : Math.max(30, Math.min(140, (bounds[3] - bounds[0]) * 0.5));
    controls.pitch = stage.scale > 1 ? 1.1 : 0.8;
  }
  view = null;
}
/** Moves the camera of a spectator, and asks for what it sees. */
function moveCamera(seconds) {
  const [forward, left] = controls.direction;
  const speed = controls.distance * seconds, cos = Math.cos(controls.yaw), sin = Math.sin(controls.yaw);
  centre[0] += (forward * cos - left * sin) * speed;
  centre[1] += (forward * sin + left * cos) * speed;
  const radius = controls.distance * viewShare;
  const isNear = view !== null && Math.hypot(view.x - centre[0], view.y - centre[1]) < radius * 0.2;
  if (client.welcome === null || (isNear && Math.abs(view.radius / radius - 1) < 0.2)) return;
  view = { x: centre[0], y: centre[1], radius };
  client.setView(centre, radius * 1.3);
}

/** Objects at the displayed time, and the own avatar among them. */
function drawObjects(now) {
  const own = client.welcome?.avatar || null;
  touching.begin(now);
  bodies.begin(now, client.shapes, { own, isGhost: layers.ghosts ? regions.isGhost : null, marked: touching.marked });
  if (timeline.time !== null) {
    const past = client.sampleHistory(timeline.time, visitAndMark);
    if (past !== null) touching.set(past.touching, now);
    if (past?.own) drawOwn(past.own, ...past.own.position, past.own.orientation);
  } else {
    client.sample(visitAndMark, now);
    const ahead = client.predictOwn(now);
    if (ahead !== null && client.own !== null) {
      drawOwn(client.own, ahead.x, ahead.y, ahead.z,
        [0, 0, Math.sin(ahead.heading / 2), Math.cos(ahead.heading / 2)]);
    }
  }
  bodies.end();
  touching.end();
}
let marked = null;
function visitAndMark(object, x, y, z, qx, qy, qz, qw) {
  if (object.number === inspector.number) marked = [x, y];
  touching.visit(object.number, x, y, z);
  bodies.visit(object, x, y, z, qx, qy, qz, qw);
}
const ownObject = { number: 0, generation: 0, category: 0, shape: 0 };
function drawOwn({ number, shape }, x, y, z, orientation) {
  ownObject.number = number;
  ownObject.shape = shape;
  visitAndMark(ownObject, x, y, z, ...orientation);
  centre[0] = x;
  centre[1] = y;
  centre[2] = z + eyeHeight;
}

let last = performance.now();
/** One frame of the page, at a time of performance.now(). */
function drawFrame(now) {
  const seconds = Math.min(0.1, (now - last) / 1000);
  last = now;
  marked = null;
  if (timeline.time === null) {
    if (isWatching) moveCamera(seconds);
    else client.setInput(controls.wish(client.prediction?.state?.heading ?? 0));
  }
  drawObjects(now);
  stage.mark(marked);
  regions.mesh.visible = layers.regions && regions.map !== null;
  stage.look(centre, controls.yaw, isAbove ? 1.52 : controls.pitch, isAbove ? Math.max(40, controls.distance) : controls.distance);
  stage.render();
}
function frame() {
  const now = performance.now();
  drawFrame(now);
  frameTimes.push(performance.now() - now);
  if (frameTimes.length > 240) frameTimes.shift();
  requestAnimationFrame(frame);
}

function setLayer(name, isOn) {
  layers[name] = isOn;
  document.querySelector(`[data-layer="${name}"]`).setAttribute("aria-pressed", String(isOn));
  if (name in { load: 1, counts: 1, sent: 1 }) charts.show(name, isOn);
  if (isOn && name !== "sent") watchNodes();
}
for (const button of document.querySelectorAll("[data-layer]")) {
  button.addEventListener("click", () => setLayer(button.dataset.layer, !layers[button.dataset.layer]));
}
element("theme").addEventListener("click", () => theme.toggle());
element("view").addEventListener("click", () => { isAbove = !isAbove; });
addEventListener("keydown", (event) => {
  if (event.target instanceof HTMLInputElement || event.ctrlKey || event.metaKey || event.altKey) return;
  const name = Object.keys(layers)[Number(event.key) - 1];
  if (name !== undefined) setLayer(name, !layers[name]);
  else if (event.code === "KeyV") isAbove = !isAbove;
  else if (event.code === "KeyL") theme.toggle();
  else if (event.code === "Escape") { inspector.close(); }
  else if (event.code === "Space" && !(event.target instanceof HTMLButtonElement)) timeline.toggle();
  else if (event.key === "+" || event.key === "-") controls.zoom(event.key === "+" ? 0.8 : 1.25);
});
controls.onClick = (x, y) => {
  const number = bodies.pick(stage.rayAt(x, y));
  if (number === null) inspector.close();
  else client.describe(number);
};

if (isWatching) element("help").textContent = "Move: W A S D or arrow keys. Turn: drag. Zoom: wheel. Click an object for its state.";
if (fragment.has("operate")) watchNodes();
client.connect();
// A browser may keep a page that was left, with its connections.
addEventListener("pagehide", () => { for (const each of [client, monitor]) each?.close(); });
addEventListener("pageshow", ({ persisted }) => { if (persisted) for (const each of [client, monitor]) each?.connect(); });
requestAnimationFrame(frame);

/** For tests: the parts of the page, and counts of the last frame. */
window.ringfence = {
  drawFrame, client, controls, bodies, regions, timeline, touching, stage, layers,
  get monitor() { return monitor; },
  get status() { return monitorStatus; },
  get drawCalls() { return stage.drawCalls; },
  get frameTimes() { return frameTimes; },
  get displayed() { return bodies.slots.size; },
};
