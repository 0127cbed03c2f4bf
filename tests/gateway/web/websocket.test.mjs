// The edge against another implementation of WebSockets: fragments, close codes, sizes.
import assert from "node:assert/strict";
import { writeFileSync } from "node:fs";
import { join } from "node:path";
import test from "node:test";

import { read, write } from "../../../engine/gateway/web/client/codec.js";
import { atEnd, load, patience_ms, run, serve, temporaryFolder } from "./harness.mjs";

const WebSocket = load("ws");
const key = "0123456789abcdef0123456789abcdef";

function open(t, url, path = "/play") {
  const socket = new WebSocket(url.replace(/^http/, "ws") + path);
  atEnd(t, () => socket.terminate());
  return new Promise((resolve, reject) => {
    socket.on("open", () => resolve(socket));
    socket.on("error", reject);
  });
}
const closed = (socket) => new Promise((resolve, reject) => {
  const timer = setTimeout(() => reject(new Error("the socket stays open")), patience_ms);
  socket.on("close", (code, reason) => { clearTimeout(timer); resolve([code, String(reason)]); });
});
const message = (socket, type) => new Promise((resolve) => {
  socket.on("message", (data) => { const found = read(data); if (found.type === type) resolve(found); });
});

test("a message in fragments is one message", async (t) => {
  const { url } = await serve(t, "--objects", "5");
  const socket = await open(t, url);
  const welcome = message(socket, "welcome");
  const hello = write.hello("");
  for (let at = 0; at < hello.length; ++at) socket.send(hello.subarray(at, at + 1), { fin: at === hello.length - 1 });
  assert.equal((await welcome).role, "play");
  const shape = message(socket, "shape");
  const ask = write.getShape(3);
  socket.send(ask.subarray(0, 1), { fin: false });
  socket.ping();
  socket.send(ask.subarray(1), { fin: true });
  assert.equal((await shape).shape, 3);
});

test("what is not allowed is answered with its close code and a reason", async (t) => {
  const { url } = await serve(t, "--objects", "5");
  const cases = [
    [1003, (socket) => socket.send("a text")],
    [1009, (socket) => socket.send(Buffer.alloc(2049))],
    [1009, (socket) => { socket.send(Buffer.alloc(2000), { fin: false }); socket.send(Buffer.alloc(2000)); }],
    [4400, (socket) => socket.send(Buffer.of(99))],
    [4400, (socket) => socket.send(write.ack(1))],
    [4400, (socket) => { socket.send(write.hello("")); socket.send(write.view([0, 0, 0], 1)); }],
    [4400, (socket) => { socket.send(write.hello("")); socket.send(write.input(0, 1, 0, Buffer.alloc(33))); }],
    [4401, (socket) => socket.send(write.hello("not.a.token"))],
    [4408, () => {}],
    [4429, (socket) => { socket.send(write.hello("")); for (let i = 0; i < 5000; ++i) socket.send(write.ack(1)); }],
  ];
  for (const [code, act] of cases) {
    const socket = await open(t, url);
    const end = closed(socket);
    act(socket);
    const [found, reason] = await end;
    assert.equal(found, code, `${act}: ${found} ${reason}`);
    assert.notEqual(reason, "");
  }
});

test("tokens decide who enters where, and a user who connects again replaces its connection", async (t) => {
  const file = join(temporaryFolder(t), "key");
  writeFileSync(file, key);
  const { url } = await serve(t, "--objects", "5", "--token-key", file);
  const token = async (...args) => (await run("token", "--key", file, ...args)).trim();
  const player = await token("--user", "7");
  const first = await open(t, url);
  first.send(write.hello(player));
  assert.equal((await message(first, "welcome")).user, 7);
  const replaced = closed(first);
  const second = await open(t, url);
  second.send(write.hello(player));
  await message(second, "welcome");
  assert.equal((await replaced)[0], 4409);
  for (const [code, path, text] of [[4401, "/play", ""], [4403, "/watch", player],
    [4403, "/play", await token("--role", "watch")], [4401, "/play", await token("--user", "7", "--world", "other")]]) {
    const socket = await open(t, url, path);
    const end = closed(socket);
    socket.send(write.hello(text));
    assert.equal((await end)[0], code, path);
  }
});

test("the end of the program closes connections with 1001", async (t) => {
  const { url, stop } = await serve(t, "--objects", "5");
  const socket = await open(t, url);
  socket.send(write.hello(""));
  await message(socket, "welcome");
  const end = closed(socket);
  await stop();
  assert.equal((await end)[0], 1001);
});
