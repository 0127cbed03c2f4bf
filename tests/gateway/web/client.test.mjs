// client.js against the program.
import assert from "node:assert/strict";
import { writeFileSync } from "node:fs";
import { join } from "node:path";
import test from "node:test";

import { Client } from "../../../engine/gateway/web/client/client.js";
import { atEnd, crateScene, eventOf, load, run, serve, start, temporaryFolder } from "./harness.mjs";

const WebSocket = load("ws");

async function connected(t, url, options = {}) {
  const client = new Client(url, { WebSocket, ...options });
  atEnd(t, () => client.close());
  const opened = eventOf(client, "open");
  client.connect();
  await opened;
  return client;
}
const updateWhere = (client, matches) => eventOf(client, "update", matches);

for (const network of ["", "delay=100ms,jitter=40ms,loss=5%"]) {
  test(`the predicted avatar is where the server puts it later, network "${network}"`, async (t) => {
    const { url } = await serve(t, "--objects", "0", "--nodes", "1", ...(network ? ["--network", network] : []));
    const client = await connected(t, url);
    const predicted = new Map(); // number of ticks → state
    client.setInput({ x: 1, y: 0.5, heading: 0.5 });
    const { prediction } = client;
    const tick = prediction.tick.bind(prediction);
    prediction.tick = (...args) => {
      const isNew = tick(...args);
      if (prediction.state !== null) predicted.set(prediction.tickCount, { ...prediction.state });
      return isNew;
    };
    let compared = 0, worst = 0;
    await updateWhere(client, ({ own, sequence, age }) => {
      const first = prediction.firstTicks.get(sequence);
      if (own === null || first === undefined) return false;
      // The prediction has tickCount frames behind it; the server has first + age + 1 of them.
      const known = predicted.get(first + age + 1);
      if (known !== undefined) {
        worst = Math.max(worst, Math.hypot(known.x - own.position[0], known.y - own.position[1]));
        ++compared;
      }
      return compared >= 40;
    });
    assert.ok(worst < 0.05, `${worst} m`);
    assert.ok(Math.hypot(...client.own.position.slice(0, 2)) > 2);
  });
}

test("an avatar that a crate stops is not predicted beyond it", async (t) => {
  const { url } = await serve(t, "--scene", crateScene(t));
  const client = await connected(t, url);
  const atCrate = []; // where the avatar is drawn while it touches the crate
  let farthest = -Infinity;
  client.setInput({ x: 1, y: 0, heading: 0, run: true });
  await updateWhere(client, ({ own }) => {
    const drawn = client.predictOwn();
    if (own === null || drawn === null) return false;
    farthest = Math.max(farthest, drawn.x);
    if (client.contacts.some(({ number }) => number === 1)) atCrate.push(drawn.x);
    return atCrate.length >= 40;
  });
  // It touches the crate at 7.9 m and runs 0.35 m in a frame. A prediction without crates would pass 10 m.
  assert.ok(farthest < 8.6, `${farthest} m`);
  const resting = atCrate.slice(-10);
  assert.ok(Math.min(...resting) > 7.7 && Math.max(...resting) < 8.1, `${resting}`);
});

// A welcome of which all but the version is 0 or empty; and an update of frame 5 with nothing in it.
const welcomeBytes = Uint8Array.from({ length: 66 }, (_, index) => [1, 1][index] ?? 0);
const emptyUpdate = Uint8Array.from({ length: 17 }, (_, index) => [2, 0, 5][index] ?? 0);

test("an update that arrives before the welcome is ignored", () => {
  const transport = { send() {}, close() {} };
  const client = new Client("http://gateway.example", { makeTransport: () => transport });
  const events = [];
  for (const type of ["open", "update", "notice"]) client.addEventListener(type, () => events.push(type));
  client.connect();
  transport.onmessage(emptyUpdate);
  assert.deepEqual(events, []);
  transport.onmessage(welcomeBytes);
  transport.onmessage(emptyUpdate);
  assert.deepEqual(events, ["open", "update"]);
});

test("two clients see each other, and one that left is removed", async (t) => {
  const { url } = await serve(t, "--objects", "10", "--grace", "0");
  const first = await connected(t, url), second = await connected(t, url);
  await updateWhere(first, () => first.objects.has(second.welcome.avatar));
  await updateWhere(second, () => second.objects.has(first.welcome.avatar));
  second.setInput({ x: -1, y: 0, heading: 0 });
  const before = first.objects.get(second.welcome.avatar).position[0];
  await updateWhere(first, () => first.objects.get(second.welcome.avatar).position[0] < before - 1);
  second.close();
  await updateWhere(first, () => !first.objects.has(second.welcome.avatar));
});

test("a guest comes back to its avatar after an interruption", async (t) => {
  const { url } = await serve(t, "--objects", "10");
  const client = await connected(t, url);
  const { avatar, user } = client.welcome;
  client.setInput({ x: 1, y: 0, heading: 0 });
  await updateWhere(client, ({ own }) => own !== null && Math.hypot(own.position[0], own.position[1]) > 1);
  client.transport.socket.terminate();
  await eventOf(client, "close");
  const welcome = await eventOf(client, "open");
  assert.deepEqual([welcome.avatar, welcome.user], [avatar, user]);
});

test("a player comes back to its avatar in a world that was killed and continued from its journal", async (t) => {
  const folder = temporaryFolder(t), key = join(folder, "key"), journal = join(folder, "journal");
  writeFileSync(key, "0123456789abcdef0123456789abcdef");
  const token = (await run("token", "--key", key, "--user", "7")).trim();
  const killed = await serve(t, "--objects", "50", "--token-key", key, "--journal", journal, "--sync", "always");
  const before = await connected(t, killed.url, { token, reconnect: false });
  before.setInput({ x: 1, y: 0, heading: 0 });
  await updateWhere(before, ({ own }) => own !== null && Math.hypot(own.position[0], own.position[1]) > 1);
  await killed.stop("SIGKILL");
  const { url } = await start(t, "resume", journal, "--frames", "0", "--token-key", key);
  const after = await connected(t, url, { token });
  assert.deepEqual([after.welcome.user, after.welcome.avatar], [7, before.welcome.avatar]);
  // No frame that its player saw is lost, and in the frames since then it went no farther than it can walk.
  const { own } = await updateWhere(after, (update) => update.own !== null);
  const frames = after.statistics.frame - before.statistics.frame;
  const { walkSpeed, step } = after.welcome.parameters;
  const moved = Math.hypot(own.position[0] - before.own.position[0], own.position[1] - before.own.position[1]);
  assert.ok(frames > 0 && moved < 0.05 + walkSpeed * step * frames, `${moved} m in ${frames} frames`);
});

test("history gives the states of the past, and forgets what is too old or too large", async (t) => {
  const { url } = await serve(t, "--objects", "2000", "--robots", "20");
  const client = await connected(t, url, { historyBytes: 400_000 });
  const states = new Map(); // server time → positions
  await updateWhere(client, ({ time }) => {
    states.set(time / 1000, new Map(Array.from(client.objects, ([number, { position }]) => [number, position.slice()])));
    return states.size >= 150;
  });
  const [first, last] = client.history.range;
  assert.ok(client.history.bytes <= 400_000 && last - first > 1000);
  let compared = 0;
  for (const [time, positions] of [...states].filter(([time]) => time >= first && time < last).reverse()) {
    client.sampleHistory(time, ({ number, category }, x, y, z) => {
      const expected = positions.get(number);
      if (expected === undefined || category === 3) return; // the update after it is applied already
      ++compared;
      assert.ok(Math.hypot(x - expected[0], y - expected[1], z - expected[2]) < 0.3, `${number} at ${time}`);
    });
  }
  assert.ok(compared > 1000);
});

test("a message that is not as described ends the connection for good, and says so", () => {
  // Another type; an update that moves an object which has not entered.
  for (const bytes of [[99], [2, 0, 5, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 6, 0, 0, 0, 0, 0]]) {
    const transport = { send() {}, close() { transport.onclose({ code: 1000, reason: "" }); } };
    const client = new Client("http://gateway.example", { makeTransport: () => transport });
    const events = [];
    for (const type of ["notice", "close"]) client.addEventListener(type, ({ detail }) => events.push([type, detail]));
    client.connect();
    transport.onmessage(welcomeBytes);
    transport.onmessage(Uint8Array.from(bytes));
    assert.deepEqual(events.map(([type]) => type), ["close", "notice"]);
    assert.equal(events[0][1].isFinal, true);
    assert.match(events[1][1], /unknown type 99|object 3 moves/);
  }
});

test("a spectator sees the part of the world that it asks for, and the status of the nodes", async (t) => {
  const { url } = await serve(t, "--objects", "2000", "--nodes", "2");
  const client = await connected(t, url, { path: "/watch" });
  await updateWhere(client, () => client.objects.size >= 1990);
  client.setView([0, 0, 0], 30);
  await updateWhere(client, () => client.objects.size > 20 && client.objects.size < 400);
  for (const { position, category } of client.objects.values()) {
    if (category !== 3) assert.ok(Math.hypot(...position) < 35);
  }
  const status = await eventOf(client, "status");
  assert.equal(status.nodes.length, 2);
  assert.match(status.digest, /^[0-9a-f]{16}$/);
});
