// Frames that were doubted, in memory.
//   INBOX=10000   how many there are

import { json, problem } from "./answers.mjs";
import { noteAudit } from "./audit.mjs";
import { picture } from "./pictures.mjs";
import { addLabeled } from "./sets.mjs";

const ROOMS = ["kitchen", "hall", "bath", "bedroom", "study"];
const REASONS = [
  ["unknown"],
  ["low"],
  ["torn"],
  ["filter_apart", "low"],
  ["shadow_apart"],
  ["wrong"],
];
const COUNT = Number(process.env.INBOX ?? 400);

const settings = {
  all: true,
  robots: [],
  keys: [],
  every_s: 10,
  probability: 0.6,
  max_frames: 10_000,
  max_bytes: 2 * 2 ** 30,
  max_days: 30,
};
let policy = { train_after: 0, publish: "nothing", effort: "default" };

const share = (seed) => ((seed * 2654435761) % 1000) / 1000;

function made(id) {
  const reasons = REASONS[id % REASONS.length];
  const room = ROOMS[(id * 7) % ROOMS.length];
  const other = ROOMS[(id * 7 + 1 + (id % 3)) % ROOMS.length];
  const probability = 0.3 + 0.4 * share(id);
  return {
    id,
    at: new Date(Date.now() - id * 47_000).toISOString(),
    robot: `robot-${1 + (id % 4)}`,
    room,
    known: !reasons.includes("unknown"),
    ...(reasons.includes("unknown") ? { unknown: id % 2 ? "new_place" : "unsure" } : {}),
    probability,
    probabilities: [
      { room, probability },
      { room: other, probability: (1 - probability) * 0.7 },
      {
        room: ROOMS.find((one) => one !== room && one !== other),
        probability: (1 - probability) * 0.2,
      },
    ],
    novelty: share(id + 3),
    ...(reasons.includes("filter_apart") ? { filtered_room: other } : {}),
    ...(reasons.includes("shadow_apart") ? { shadow_room: other } : {}),
    ...(reasons.includes("wrong") ? { said: other } : {}),
    reasons,
    value: 1 - probability * share(id + 1),
    model: { name: "home", version: 3 },
    revision: 1,
  };
}

const frames = Array.from({ length: COUNT }, (_, at) => made(at + 1));
// Somebody else has labeled these in the meantime.
for (const at of [4, 11]) {
  if (frames[at]) frames[at].stolen = true;
}

const told = (frame) => {
  const copy = { ...frame };
  delete copy.stolen;
  return copy;
};

function listed(query) {
  const state = query.get("state") ?? "open";
  const wanted = frames.filter(
    (frame) =>
      (state === "all" || (state === "labeled") === Boolean(frame.label)) &&
      (!query.get("reason") || frame.reasons.includes(query.get("reason"))) &&
      (!query.get("robot") || frame.robot === query.get("robot")) &&
      (!query.get("room") || frame.room === query.get("room")),
  );
  const byValue = query.get("sort") !== "newest";
  wanted.sort((a, b) => (byValue ? b.value - a.value : a.id - b.id));
  const after = Number(query.get("after") ?? 0);
  const until = after + Number(query.get("limit") ?? 100);
  const open = frames.filter(({ label }) => !label).length;
  return json(200, {
    total: wanted.length,
    open,
    frames: wanted.slice(after, until).map(told),
    ...(until < wanted.length ? { next: String(until) } : {}),
  });
}

function labeled(asked) {
  const answer = { labeled: [], conflicts: [] };
  const at = new Date().toISOString();
  for (const { id, revision } of asked.frames) {
    const frame = frames.find((one) => one.id === id);
    if (frame?.stolen) {
      frame.stolen = false;
      frame.revision += 1;
      frame.label = { set: "home", room: "hall", path: `hall/inbox/${id}.jpg`, by: "ann", at };
    }
    if (!frame || frame.revision !== revision) {
      answer.conflicts.push({
        id,
        label: frame?.label,
        reason: frame ? "ann labeled it in the meantime" : "it is not there any more",
      });
      continue;
    }
    const drive = asked.drive ?? `inbox-${at.slice(0, 10)}`;
    frame.revision += 1;
    frame.label = {
      set: asked.set,
      room: asked.room,
      path: `${asked.room}/${drive}/${id}.jpg`,
      by: "admin",
      at,
    };
    answer.labeled.push(told(frame));
  }
  if (answer.labeled.length > 0) {
    const paths = answer.labeled.map(({ label }) => label.path);
    const undo = () =>
      frames
        .filter(({ label }) => paths.includes(label?.path))
        .forEach((frame) => {
          delete frame.label;
          frame.revision += 1;
        });
    answer.change = addLabeled(asked.set, paths, undo);
    noteAudit("label_frames", asked.set, `${paths.length} frames as ${asked.room}`);
  }
  return json(200, answer);
}

/** Calls below `v1/inbox`. */
export function inboxCall(request, url) {
  const [, , , part, last] = url.pathname.split("/");
  const { method } = request;
  if (part === undefined && method === "POST") {
    const frame = {
      ...made(frames.length + 1),
      reasons: ["wrong"],
      room: url.searchParams.get("room") ?? "",
      said: url.searchParams.get("right") ?? undefined,
    };
    frames.push(frame);
    return json(201, told(frame));
  }
  if (part === undefined) return listed(url.searchParams);
  if (part === "rule") {
    if (method === "PUT") {
      Object.assign(settings, request.json());
      noteAudit("inbox_rule", "inbox", settings.all ? "all robots" : "some robots");
    }
    return json(200, { ...settings, frames: frames.length, bytes: frames.length * 61_000 });
  }
  if (part === "policy") {
    if (method === "PUT") policy = request.json();
    return json(200, policy);
  }
  if (part === "labels") return labeled(request.json());
  if (part === "discard") {
    const ids = new Set(request.json().frames.map(({ id }) => id));
    const before = frames.length;
    frames.splice(0, frames.length, ...frames.filter(({ id }) => !ids.has(id)));
    return json(200, { discarded: before - frames.length });
  }
  const frame = frames.find(({ id }) => id === Number(part));
  if (!frame) return problem(404, "not-found", "This frame is not in the inbox any more.");
  if (last === "picture") {
    return { status: 200, type: "image/svg+xml", body: picture(frame.room, `inbox ${frame.id}`) };
  }
  return undefined;
}
