// client.js reads what the gateway's codec writes.
import assert from "node:assert/strict";
import { execFileSync } from "node:child_process";
import test from "node:test";

import { read, turnOf, write } from "../../../engine/gateway/web/client/codec.js";

const messages = JSON.parse(execFileSync(process.env.RINGFENCE_WEB_MESSAGES, { maxBuffer: 1 << 28 }));
const bytesOf = (hex) => Uint8Array.from(Buffer.from(hex, "hex"));

/** The same value as JSON has it; numbers may differ by the rounding of 32-bit floats. */
function assertSame(found, expected, path) {
  if (found instanceof Uint8Array) return assert.equal(Buffer.from(found).toString("hex"), expected, path);
  if (typeof expected === "number") {
    return assert.ok(Math.abs(found - expected) <= 1e-6 * Math.max(1, Math.abs(expected)), `${path}: ${found}, ${expected}`);
  }
  if (expected === null || typeof expected !== "object") return assert.equal(found, expected, path);
  if (Array.isArray(expected)) assert.equal(found.length, expected.length, path);
  else assert.deepEqual(Object.keys(found).sort(), Object.keys(expected).sort(), path);
  for (const key of Object.keys(expected)) assertSame(found[key], expected[key], `${path}.${key}`);
}

test("every message that the gateway writes is read with the same contents", () => {
  assert.ok(messages.length > 500);
  messages.forEach(({ bytes, message }, index) => assertSame(read(bytesOf(bytes)), message, `message ${index}`));
});

test("a message that is cut short is refused with a RangeError", () => {
  for (const { bytes } of messages.slice(0, 60)) {
    const whole = bytesOf(bytes);
    for (let size = 0; size < whole.length; ++size) assert.throws(() => read(whole.subarray(0, size)), RangeError);
  }
});

test("random bytes are read or refused with a RangeError", () => {
  let state = 1;
  const random = () => (state = (Math.imul(state, 1664525) + 1013904223) >>> 0) >>> 8;
  for (let round = 0; round < 20000; ++round) {
    const bytes = Uint8Array.from({ length: 1 + (random() % 60) }, () => random() & 255);
    bytes[0] = 1 + (random() % 4);
    try {
      read(bytes);
    } catch (error) {
      assert.ok(error instanceof RangeError, String(error.stack));
    }
  }
});

test("an orientation has unit length", () => {
  for (let bits = 0; bits < 2 ** 32; bits += 7654321) assert.ok(Math.abs(Math.hypot(...turnOf(bits)) - 1) < 1e-6);
});

test("messages of clients have the documented bytes", () => {
  const hex = (bytes) => Buffer.from(bytes).toString("hex");
  assert.equal(hex(write.hello("ab")), "0101026162");
  assert.equal(hex(write.input(300, 128, 0x1234, Uint8Array.of(1, 2))), "02ac0280013412020102");
  assert.equal(hex(write.ack(2 ** 40)), "03808080808020");
  assert.equal(hex(write.getShape(5)), "0405");
  assert.equal(hex(write.application(Uint8Array.of(9))), "0509");
  assert.equal(hex(write.view([1, 0, 0], 2)), "06000000000000f03f" + "0".repeat(32) + "0000000000000040");
  assert.equal(hex(write.describe(200)), "07c801");
  assert.equal(hex(write.command("kill", 3)), "080203");
});
