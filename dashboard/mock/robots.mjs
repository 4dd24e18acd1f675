// Robots that wander through a home.

import { readFileSync } from "node:fs";
import { json, problem } from "./answers.mjs";

export const ROOMS = ["hall", "kitchen", "living room", "bath", "bedroom", "study"];
export const DOORS = {
  hall: ["kitchen", "living room", "bath", "bedroom"],
  kitchen: ["hall", "living room"],
  "living room": ["hall", "kitchen", "study"],
  bath: ["hall"],
  bedroom: ["hall"],
  study: ["living room"],
};
export const MODEL = { name: "home", version: 3 };
const REASONS = ["unsure", "new_place", "no_detail", "dark", "covered"];
const N_ROBOTS = Number(process.env.ROBOTS ?? 12);
const TICK_MS = 500;
const LOST_AFTER_S = 10;

// Those that lie beside the model that comes with the service.
const GOLDEN = new URL("../../models/simulated-lab/1/golden/", import.meta.url);
const FRAMES = ["bathroom", "corridor", "one_person_office", "printer_area"].map((name) =>
  readFileSync(new URL(`${name}.jpeg`, GOLDEN)),
);

const any = (list) => list[Math.floor(Math.random() * list.length)];

function probabilities(room, sure) {
  const others = ROOMS.filter((other) => other !== room);
  const rest = 1 - sure;
  const list = [{ room, probability: sure }];
  others.forEach((other, at) =>
    list.push({ room: other, probability: (rest * 2 ** -at) / 1.9375 }),
  );
  return list.slice(0, 5);
}

function robot(at) {
  const id = at === 1 ? "<b>robot & co</b>" : `robot-${String(at + 1).padStart(2, "0")}`;
  const room = ROOMS[at % ROOMS.length];
  return {
    id,
    robot: id,
    stream: at % 4 === 3 ? undefined : `c41f07d2a95be8${at}`,
    via: at % 4 === 3 ? "rest" : "stream",
    connected: at % 11 !== 10,
    room,
    since: Date.now() - at * 7000,
    known: true,
    sure: 0.9,
    frame: 1,
    seen: Date.now(),
    frames: { accepted: 400 + at, results: 390, errors: 0, dropped: { superseded: 4 + at } },
    ribbon: ROOMS.map((room, n) => ({
      room,
      known: n !== 2,
      from: Date.now() - (6 - n) * 60_000,
      until: Date.now() - (5 - n) * 60_000,
    })),
  };
}

const robots = Array.from({ length: N_ROBOTS }, (_, at) => robot(at));
const readers = new Set();

function told(it) {
  const away = (Date.now() - it.unknownSince) / 1000;
  return {
    id: it.id,
    robot: it.robot,
    stream: it.stream,
    via: it.via,
    connected: it.connected,
    last_seen_s: (Date.now() - it.seen) / 1000,
    room: it.room,
    known: it.known,
    unknown: it.known ? undefined : it.unknown,
    novelty: it.known ? 0.04 : 0.7,
    probability: it.sure,
    probabilities: probabilities(it.room, it.sure),
    in_room_s: (Date.now() - it.since) / 1000,
    lost: !it.known && away > LOST_AFTER_S,
    lost_s: !it.known && away > LOST_AFTER_S ? away : undefined,
    frames_per_s: it.connected ? 4.8 + Math.random() * 0.4 : 0,
    age_ms: 30 + Math.random() * 40,
    latency_ms: 8 + Math.random() * 5,
    frames: it.frames,
    frame: it.frame,
    model: MODEL,
  };
}

function step(it) {
  if (!it.connected) return;
  it.seen = Date.now();
  it.frame += 1;
  it.frames.accepted += 2;
  it.frames.results += 2;
  if (Math.random() < 0.02) {
    it.room = any(DOORS[it.room]);
    it.since = Date.now();
  }
  if (Math.random() < (it.known ? 0.002 : 0.02)) {
    it.known = !it.known;
    it.unknown = any(REASONS);
    it.unknownSince = Date.now();
  }
  it.sure = it.known ? 0.8 + Math.random() * 0.19 : 0.3 + Math.random() * 0.3;
  const last = it.ribbon.at(-1);
  if (last.room === it.room && last.known === it.known) last.until = Date.now();
  else it.ribbon.push({ room: it.room, known: it.known, from: Date.now(), until: Date.now() });
}

setInterval(() => {
  robots.forEach(step);
  const changed = robots.filter(({ connected }) => connected).map(told);
  const lost_events = Math.random() < 0.01 ? 7 : 0;
  const data = JSON.stringify({
    at: new Date().toISOString(),
    robots: changed,
    gone: [],
    lost_events,
  });
  for (const reader of readers) reader.write(`event: live\ndata: ${data}\n\n`);
}, TICK_MS);

/** The call `v1/live`. */
export const liveCall = () => ({ events: true });

export function liveEvents(outgoing) {
  outgoing.writeHead(200, { "Content-Type": "text/event-stream", "Cache-Control": "no-store" });
  const data = JSON.stringify({
    at: new Date().toISOString(),
    robots: robots.map(told),
    gone: [],
    lost_events: 0,
  });
  outgoing.write(`event: live\ndata: ${data}\n\n`);
  readers.add(outgoing);
  outgoing.on("close", () => readers.delete(outgoing));
}

function info(it) {
  const ribbon = it.ribbon.map((piece) => ({
    ...piece,
    from: new Date(piece.from).toISOString(),
    until: new Date(piece.until).toISOString(),
  }));
  const answers = Array.from({ length: 12 }, (_, n) => ({
    seq: it.frame - n,
    room: it.room,
    known: n % 5 !== 4,
    probability: it.sure - n * 0.01,
    ago_s: n * 0.2,
    timings_ms: { queue: 0.2, decode: 1.9, features: 5.2, classify: 1.1 },
  }));
  return { ...told(it), mode: "latest", streaming_s: 912, answers, ribbon };
}

/** Calls below `v1/robots`. */
export function robotsCall(_request, url) {
  const [, , , id, part] = url.pathname.split("/").map(decodeURIComponent);
  if (!id) return json(200, { robots: robots.map(info) });
  const it = robots.find((one) => one.id === id);
  if (!it) return problem(404, "not-found", `There is no robot ${id}.`);
  if (part !== "frame") return json(200, info(it));
  const body = FRAMES[Math.floor(it.frame / 4) % FRAMES.length];
  return {
    status: 200,
    type: "image/jpeg",
    body,
    headers: { "X-Frame": String(it.frame), ETag: `"${it.frame}"` },
  };
}
