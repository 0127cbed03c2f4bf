// The page in a real browser without a screen. Screenshots are written to out/.
import assert from "node:assert/strict";
import { mkdirSync, writeFileSync } from "node:fs";
import { join } from "node:path";
import test from "node:test";

import { atEnd, crateScene, load, patience_ms, run, serve, temporaryFolder, view } from "./harness.mjs";

const puppeteer = load("puppeteer-core");
const out = process.env.RINGFENCE_OUT;
mkdirSync(out, { recursive: true });
const key = "0123456789abcdef0123456789abcdef";

const browser = await puppeteer.launch({ executablePath: process.env.RINGFENCE_CHROMIUM, args: ["--no-sandbox",
  "--use-gl=angle", "--use-angle=swiftshader", "--enable-unsafe-swiftshader", "--disable-dev-shm-usage"] });
test.after(() => browser.close());

/**
 * Opens the page; `before` runs in it before its own script. At the end of the test it must have logged no errors and
 * asked no other host for anything.
 */
async function open(t, url, { width = 1000, height = 640, media = [], isMobile = false, before = null } = {}) {
  const page = await (await browser.createBrowserContext()).newPage();
  const errors = [];
  page.on("console", (message) => {
    if (["error", "warn"].includes(message.type()) && !/GPU stall|GL Driver/.test(message.text())) errors.push(message.text());
  });
  page.on("pageerror", (error) => errors.push(String(error)));
  page.on("request", (request) => {
    if (new URL(request.url()).host !== new URL(url).host) errors.push(`a request to ${request.url()}`);
  });
  await page.setViewport({ width, height, isMobile, hasTouch: isMobile });
  await page.emulateMediaFeatures(media);
  if (before !== null) await page.evaluateOnNewDocument(before);
  await page.goto(url);
  atEnd(t, async () => {
    await page.close();
    assert.deepEqual(errors, []);
  });
  return page;
}
const until = (page, condition, ...args) => page.waitForFunction(condition, { timeout: patience_ms, polling: 50 }, ...args);
const ready = (page) => until(page, () => window.ringfence?.displayed > 3);
const ownPosition = (page) => page.evaluate(() => Array.from(window.ringfence.client.own.position));
const screenshot = (page, name) => page.screenshot({ path: join(out, `serve-${name}.png`) });

test("the avatar walks with keys, and a crate stops it", async (t) => {
  const { url } = await serve(t, "--scene", crateScene(t));
  const page = await open(t, url);
  await ready(page);
  await page.evaluate(() => { window.ringfence.controls.yaw = 0; });
  const [before] = await ownPosition(page);
  await page.keyboard.down("KeyW");
  await until(page, (x) => window.ringfence.client.own.position[0] > x + 1, before);
  await until(page, () => window.ringfence.client.contacts.some(({ number, phase }) => number === 1 && phase === "persist"));
  const frame = await page.evaluate(() => window.ringfence.client.statistics.frame);
  await until(page, (first) => window.ringfence.client.statistics.frame > first + 20, frame);
  const [x] = await ownPosition(page);
  await page.keyboard.up("KeyW");
  // The crate begins at 8.25 m, and the avatar has a radius of 0.35 m.
  assert.ok(x > 7.7 && x < 8.1, `${x}`);
});

test("two browsers see each other move", async (t) => {
  const { url } = await serve(t, "--objects", "40");
  const first = await open(t, url), second = await open(t, url);
  await ready(first);
  await ready(second);
  const avatar = await second.evaluate(() => window.ringfence.client.welcome.avatar);
  await until(first, (number) => window.ringfence.client.objects.has(number), avatar);
  const place = () => first.evaluate((number) => Array.from(window.ringfence.client.objects.get(number).position), avatar);
  const before = await place();
  await second.bringToFront();
  await second.keyboard.down("ArrowUp");
  await until(second, (y) => Math.abs(window.ringfence.client.own.position[1] - y) > 1, before[1]);
  await second.keyboard.up("ArrowUp");
  await until(first, (number, y) => Math.abs(window.ringfence.client.objects.get(number).position[1] - y) > 0.9, avatar, before[1]);
});

test("an operator kills a node, and the digest goes on", async (t) => {
  const file = join(temporaryFolder(t), "key");
  writeFileSync(file, key);
  const { url } = await serve(t, "--objects", "1500", "--robots", "40", "--nodes", "4", "--token-key", file);
  const token = async (...args) => (await run("token", "--key", file, ...args)).trim();
  const page = await open(t, `${url}/#token=${await token("--user", "1")}&operate=${await token("--role", "operate")}`,
    { width: 1280, height: 760, media: [{ name: "prefers-color-scheme", value: "dark" }] });
  await ready(page);
  await page.keyboard.press("Digit1");
  await page.keyboard.press("Digit3");
  await until(page, () => window.ringfence.status?.nodes.length === 4 && window.ringfence.regions.map !== null);
  const digest = await page.evaluate(() => {
    Object.assign(window.ringfence.controls, { distance: 60, pitch: 0.75, yaw: 1 });
    return window.ringfence.status.digest;
  });
  const [first] = await page.$$("#nodes button");
  await first.evaluate((button) => button.click());
  await until(page, () => window.ringfence.status.nodes.length === 3 && document.querySelector("#nodes .lost") !== null);
  const after = await page.evaluate(() => ({ digest: window.ringfence.status.digest, frame: window.ringfence.status.frame }));
  assert.notEqual(after.digest, digest);
  await until(page, ({ frame }) => window.ringfence.status.frame > frame + 20, after);
  await screenshot(page, "node-killed");
  await page.click("#add-node");
  await until(page, () => window.ringfence.status.nodes.length === 4);
});

test("a click shows an object, and a pause shows the last minute", async (t) => {
  const { url } = await serve(t, "--objects", "600", "--robots", "10");
  const page = await open(t, url, { width: 1280, height: 760 });
  await ready(page);
  await until(page, () => window.ringfence.client.history.range?.[1] - window.ringfence.client.history.range?.[0] > 4000);
  // The avatar is in the middle.
  await page.mouse.click(640, 385);
  await until(page, () => !document.getElementById("object").hidden);
  assert.match(await page.$eval("#object-fields", (list) => list.textContent), /avatar/);
  await screenshot(page, "light");
  await page.keyboard.press("Space");
  await until(page, () => !document.getElementById("timeline").hidden);
  const moving = () => page.evaluate(() => {
    const { client, timeline } = window.ringfence;
    const positions = {};
    client.sampleHistory(timeline.time, ({ number, category }, x, y) => { if (category !== 3) positions[number] = [x, y]; });
    return positions;
  });
  const late = await moving();
  await page.$eval("#moment", (range) => { range.value = 0.1; range.dispatchEvent(new Event("input")); });
  const early = await moving();
  const moved = Object.keys(late).filter((number) => number in early &&
    Math.hypot(late[number][0] - early[number][0], late[number][1] - early[number][1]) > 0.5);
  assert.ok(moved.length > 3, `${moved.length} objects moved`);
  await screenshot(page, "paused");
  await page.click("#resume");
  assert.ok(await page.$eval("#timeline", (panel) => panel.hidden));
});

test("20,000 objects take at most 20 draw calls, and a visitor who comes late sees all of them", async (t) => {
  const { url } = await serve(t, "--objects", "20000", "--nodes", "1");
  const page = await open(t, `${url}/?watch`, { width: 320, height: 240 });
  await until(page, () => window.ringfence?.client.objects.size > 0);
  const late_ms = await page.evaluate(() => performance.now());
  await page.evaluate(() => { window.ringfence.controls.distance = 700; });
  await until(page, () => window.ringfence.displayed === 20000);
  const calls = await page.evaluate(() => window.ringfence.drawCalls);
  // Software draws a few frames in a second, so the script is measured alone, as warm as it is in a real browser.
  const script_ms = await page.evaluate(() => {
    const { stage, drawFrame } = window.ringfence;
    const { render } = stage;
    stage.render = () => {};
    const times = [];
    for (let round = 0; round < 200; ++round) {
      const begin = performance.now();
      drawFrame(begin);
      times.push(performance.now() - begin);
    }
    stage.render = render;
    return times.slice(100).sort((a, b) => a - b)[50];
  });
  t.diagnostic(`${calls} draw calls; ${script_ms.toFixed(1)} ms of script in a frame, without drawing; objects after ${
    Math.round(late_ms)} ms`);
  assert.ok(calls <= 20, `${calls} draw calls`);
});

test("on a phone there is a stick, and everything is on the screen", async (t) => {
  const { url } = await serve(t, "--objects", "300", "--robots", "10");
  const page = await open(t, url, { width: 390, height: 780, isMobile: true });
  await ready(page);
  const stick = await page.$("#stick");
  const { x, y, width, height } = await stick.boundingBox();
  assert.ok(width > 80);
  const before = await ownPosition(page);
  const touch = await page.touchscreen.touchStart(x + width / 2, y + height / 2);
  await touch.move(x + width / 2, y + 5);
  await until(page, (p) => Math.hypot(window.ringfence.client.own.position[0] - p[0],
    window.ringfence.client.own.position[1] - p[1]) > 1, before);
  await screenshot(page, "phone");
  await touch.end();
  assert.ok(await page.evaluate(() => document.documentElement.scrollWidth <= innerWidth));
  const hidden = await page.$$eval("#layers button", (buttons) => buttons.filter((button) => {
    const { left, right, bottom } = button.getBoundingClientRect();
    return left < 0 || right > innerWidth || bottom > innerHeight;
  }).map(({ id, dataset }) => id || dataset.layer));
  assert.deepEqual(hidden, []);
});

test("recorded air traffic is shown with losses of separation, a legend, and its end", async (t) => {
  const data = join(process.env.RINGFENCE_DATA, "air");
  const { url, ended } = await view(t, "--scene", join(data, "scene.json"), "--motion", join(data, "motion.csv"),
    "--frames", "100", "--quiet", "--tick", "20");
  // The path of players, whom a recording does not have. From the first update on, distances are taken in the update that
  // has the contact: a pair is shown for a while after it, and moves on.
  const page = await open(t, url, { before: () => {
    const distances = window.distances = [];
    let parts;
    Object.defineProperty(window, "ringfence", { get: () => parts, set: (value) => {
      parts = value;
      const { client } = value;
      client.addEventListener("update", () => {
        for (const pair of client.touching) {
          const [p, q] = pair.map((number) => client.objects.get(number).position);
          distances.push(Math.hypot(...p.map((value, axis) => value - q[axis])));
        }
      });
    } });
  } });
  await until(page, () => location.search === "?watch" && window.ringfence !== undefined);
  // What is seen while a pair is shown, in the same task of the page: a slow machine may draw it once only.
  const seen = await (await until(page, () => {
    const { touching, bodies, stage, drawCalls } = window.ringfence;
    const slots = Array.from(touching.places.keys(), (number) => bodies.slots.get(number));
    if (!touching.lines.visible || slots.includes(undefined)) return false; // a shape is not known yet
    return { label: touching.label, drawCalls, isWatching: location.search === "?watch",
      isMarked: slots.every(({ colour }) => colour === bodies.colours.flash), far: stage.camera.far };
  })).jsonValue();
  assert.equal(seen.label, "loss of separation");
  assert.ok(seen.isWatching && seen.isMarked);
  await until(page, () => window.distances.length > 0);
  const farthest = Math.max(...await page.evaluate(() => window.distances));
  assert.ok(farthest < 5.2 * 1852, `${farthest} m`); // 5 nautical miles, and how far the corners of the prisms reach
  assert.ok(seen.drawCalls <= 20 && seen.far > 1e6);
  await until(page, () => /loss of separation: \d+ now, [1-9]\d* seen/.test(document.getElementById("legend").textContent));
  await screenshot(page, "air");
  // A pair that touched and separated again between two drawn frames is drawn once.
  const drawn = await page.evaluate(() => {
    const { client, touching, drawFrame } = window.ringfence, pair = Array.from(client.objects.keys()).slice(0, 2);
    const drawnPair = (now) => {
      drawFrame(now);
      return touching.shown.has(String(pair));
    };
    const now = performance.now();
    touching.set([pair], now - 5000);
    touching.set([], now - 4000);
    return [drawnPair(now), drawnPair(now + 1)];
  });
  assert.deepEqual(drawn, [true, false]);
  await until(page, () => window.ringfence.client.statistics.frame === 99);
  await page.goto("about:blank"); // nobody watches any more
  assert.equal(await ended, 0);
});
