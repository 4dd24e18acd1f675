// The WebSocket of robots: every frame gets an answer.

import { createHash } from "node:crypto";
import { answer } from "./recognize.mjs";
import { MODEL, ROOMS } from "./robots.mjs";

const ACCEPT = "258EAFA5-E914-47DA-95CA-C5AB0DC85B11";

function message(socket, value) {
  const body = Buffer.from(JSON.stringify(value));
  const head =
    body.length < 126
      ? Buffer.from([0x81, body.length])
      : Buffer.from([0x81, 126, body.length >> 8, body.length & 255]);
  socket.write(Buffer.concat([head, body]));
}

/** Takes a whole frame of the protocol off the front of `data`; undefined if more must come. */
function take(data) {
  if (data.length < 2) return undefined;
  let size = data[1] & 127;
  let at = 2;
  if (size === 126) ((size = data.readUInt16BE(2)), (at = 4));
  else if (size === 127) ((size = Number(data.readBigUInt64BE(2))), (at = 10));
  const end = at + 4 + size;
  if (data.length < end) return undefined;
  const mask = data.subarray(at, at + 4);
  const body = data.subarray(at + 4, end).map((byte, n) => byte ^ mask[n % 4]);
  return { opcode: data[0] & 15, body, rest: data.subarray(end) };
}

export function acceptStream(request, socket) {
  const accept = createHash("sha1")
    .update(request.headers["sec-websocket-key"] + ACCEPT)
    .digest("base64");
  socket.write(
    `HTTP/1.1 101 Switching Protocols\r\nUpgrade: websocket\r\nConnection: Upgrade\r\nSec-WebSocket-Accept: ${accept}\r\n` +
      "Sec-WebSocket-Protocol: roomsight.v1\r\n\r\n",
  );
  message(socket, {
    type: "hello",
    protocol: "roomsight.v1",
    session: "secret",
    stream: "c41f07d2a95be836",
    resumed: false,
    next_seq: 0,
    model: { ...MODEL, epoch: 4, digest: "5f0c2a9be1d34c77" },
    rooms: ROOMS,
  });
  let data = Buffer.alloc(0);
  let seq = 0;
  let explain = request.url.includes("explain=true");
  socket.on("error", () => socket.destroy());
  socket.on("data", (more) => {
    data = Buffer.concat([data, more]);
    for (let frame = take(data); frame; frame = take(data)) {
      data = frame.rest;
      if (frame.opcode === 8) socket.end();
      if (frame.opcode === 1) explain = JSON.parse(frame.body.toString()).explain;
      if (frame.opcode === 2) {
        const one = answer(explain);
        const filtered = {
          room: one.room,
          probability: one.probability,
          probabilities: one.probabilities,
          known: one.known,
        };
        const result = { type: "result", seq, age_ms: 18, filtered, ...one };
        setTimeout(() => message(socket, result), 40);
        seq += 1;
      }
    }
  });
}
