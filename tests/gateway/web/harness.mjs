// Starts the program for tests, and waits for what happens instead of sleeping.
import { spawn } from "node:child_process";
import { once } from "node:events";
import { mkdtempSync, rmSync, writeFileSync } from "node:fs";
import { createRequire } from "node:module";
import { tmpdir } from "node:os";
import { join } from "node:path";

const require = createRequire(new URL("../../../engine/gateway/web/package.json", import.meta.url));
/** A module of engine/gateway/web/node_modules. */
export const load = (name) => require(name);
export const program = process.env.RINGFENCE_PROGRAM;
export const patience_ms = 60000;

const actionsAtEnd = new WeakMap();

/** Does something after the test, what was asked for last first: a page is closed before the server that it talks to. */
export function atEnd(test, action) {
  if (!actionsAtEnd.has(test)) {
    const actions = [];
    actionsAtEnd.set(test, actions);
    test.after(async () => {
      const errors = [];
      while (actions.length > 0) await Promise.resolve().then(actions.pop()).catch((error) => errors.push(error));
      if (errors.length > 0) throw errors[0];
    });
  }
  actionsAtEnd.get(test).push(action);
}

/** A folder that is removed after the test. */
export function temporaryFolder(test) {
  const folder = mkdtempSync(join(tmpdir(), "ringfence-web-"));
  atEnd(test, () => rmSync(folder, { recursive: true, force: true }));
  return folder;
}

/** A world of one wide crate in front of the places where avatars start: from x = 8.25 m on. Returns the file. */
export function crateScene(test) {
  const post = (number) => ({ id: number, category: "static", shape: "post", position: [-12, 4 * number, 0.5] });
  const scene = { format: "ringfence-scene", version: 1, bounds: { min: [-30, -30, 0], max: [30, 30, 4] },
    shapes: { crate: { type: "box", half_extents: [0.75, 30, 1] }, post: { type: "sphere", radius: 0.5 } },
    objects: [{ id: 1, category: "static", shape: "crate", position: [9, 0, 1] }, ...[2, 3, 4, 5].map(post)] };
  const file = join(temporaryFolder(test), "scene.json");
  writeFileSync(file, JSON.stringify(scene));
  return file;
}

/** Runs the program to its end: its output. Throws if it does not end with 0. */
export async function run(...args) {
  const child = spawn(program, args, { stdio: ["ignore", "pipe", "inherit"] });
  let out = "";
  child.stdout.on("data", (text) => { out += text; });
  const [code] = await once(child, "close");
  if (code !== 0) throw new Error(`ringfence ${args.join(" ")} ended with ${code}: ${out}`);
  return out;
}

/** Serves a world until the test ends: { url, stop }; stop() ends it in order and returns its output. */
export const serve = (test, ...args) => start(test, "serve", ...args);

/** The same with another command: serve, or resume and the folder of a journal. */
export async function start(test, ...args) {
  const child = spawn(program, [...args, "--listen", "127.0.0.1:0"], { stdio: ["ignore", "pipe", "inherit"] });
  let out = "";
  const closed = once(child, "close");
  const url = await new Promise((resolve, reject) => {
    child.stdout.on("data", (text) => {
      out += text;
      if (out.includes("\n")) resolve(out.slice(0, out.indexOf("\n")));
    });
    closed.then(() => reject(new Error(`ringfence ${args[0]} ended: ${out}`)));
  });
  const stop = async (signal = "SIGTERM") => {
    child.kill(signal);
    await closed;
    return out;
  };
  atEnd(test, () => stop());
  return { url, stop };
}

/** Replays a recorded world on the page until the test ends: { url, ended }; `ended` is a promise of the exit code. */
export async function view(test, ...args) {
  const child = spawn(program, ["replay", ...args, "--view", "127.0.0.1:0"], { stdio: ["ignore", "ignore", "pipe"] });
  const ended = once(child, "close").then(([code]) => code);
  let errors = "";
  const url = await new Promise((resolve, reject) => {
    child.stderr.on("data", (text) => {
      errors += text;
      const found = /(http:\S+?)\/\?watch shows the run/.exec(errors);
      if (found !== null) resolve(found[1]);
    });
    ended.then(() => reject(new Error(`ringfence replay ended: ${errors}`)));
  });
  atEnd(test, async () => {
    child.kill("SIGTERM");
    await ended;
  });
  return { url, ended };
}

/** The next event for which `matches` holds; fails after `patience_ms`. */
export function eventOf(target, type, matches = () => true) {
  return new Promise((resolve, reject) => {
    const timer = setTimeout(() => reject(new Error(`no event ${type}`)), patience_ms);
    const listener = (event) => {
      if (!matches(event.detail ?? event)) return;
      clearTimeout(timer);
      target.removeEventListener(type, listener);
      resolve(event.detail ?? event);
    };
    target.addEventListener(type, listener);
  });
}
