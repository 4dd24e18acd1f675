// Data sets, in memory.

import { picture } from "./pictures.mjs";
import { json, problem } from "./answers.mjs";
import { noteAudit } from "./audit.mjs";

const MARKUP = "<img src=x onerror=alert(1)>";
const sets = new Map();
const removed = new Map();
let lastChange = 0;

function content(text) {
  let value = 0n;
  for (const character of text) {
    value = (value * 131n + BigInt(character.codePointAt(0))) % 2n ** 64n;
  }
  return value.toString(16).padStart(16, "0");
}

function frame(room, drive, name) {
  const path = `${room}/${drive}/${name}`;
  return {
    path,
    room,
    drive,
    bytes: 48_000 + ((path.length * 977) % 30_000),
    content: content(path),
  };
}

function made(name, rooms) {
  const frames = rooms.flatMap(([room, drives, count]) =>
    drives.flatMap((drive) =>
      Array.from({ length: count }, (_, at) =>
        frame(room, drive, `${content(room + drive + at).slice(0, 12)}.jpg`),
      ),
    ),
  );
  const changed_at = new Date(Date.now() - 3_600_000).toISOString();
  sets.set(name, {
    name,
    frames,
    rooms: rooms.map(([room]) => room),
    changes: [],
    check: { state: "none", findings: [] },
    changed_at,
  });
}

made("home", [
  ["bath", ["2025-11-20-0912-40"], 34],
  ["bedroom", ["2025-11-20-0905-11", "2025-11-22-2010-03"], 41],
  ["hall", ["2025-11-20-0901-00"], 12],
  ["kitchen", ["2025-11-20-0858-02", "2025-11-22-2001-44"], 62],
  ["study", ["2025-11-20-0920-31", "2025-11-22-2016-20"], 48],
  ["elsewhere", ["stairwell"], 20],
]);
made("warehouse", [
  ["aisle 1", ["monday", "tuesday"], 2000],
  ["aisle 2", ["monday", "tuesday"], 1500],
  ["dock", ["monday"], 3000],
]);
made("strange names", [
  [MARKUP, ["'; drop table frames; --"], 6],
  ["Küche & Flur", ["1"], 8],
]);

function summary(set) {
  const bytes = set.frames.reduce((sum, { bytes }) => sum + bytes, 0);
  return {
    name: set.name,
    rooms: set.rooms.filter((room) => room !== "elsewhere").length,
    frames: set.frames.length,
    bytes,
    changed_at: set.changed_at,
  };
}

function details(set) {
  const rooms = set.rooms.map((name) => {
    const frames = set.frames.filter(({ room }) => room === name);
    const drives = [...new Set(frames.map(({ drive }) => drive))].sort();
    return {
      name,
      frames: frames.length,
      drives: drives.map((drive) => ({
        name: drive,
        frames: frames.filter((one) => one.drive === drive).length,
      })),
    };
  });
  rooms.sort(
    (a, b) => (a.name === "elsewhere") - (b.name === "elsewhere") || a.name.localeCompare(b.name),
  );
  const few = rooms
    .filter(({ frames }) => frames < 40)
    .map(({ name, frames }) => `${name} has ${frames} frames; 40 from different places help.`);
  const one = rooms
    .filter(({ drives, name }) => drives.length === 1 && name !== "elsewhere")
    .map(
      ({ name }) => `${name} was seen on one drive only: record it again at another time of day.`,
    );
  const left_out =
    set.name === "strange names" ? [{ path: `${MARKUP}/notes.txt`, reason: "not a picture" }] : [];
  return {
    name: set.name,
    bytes: summary(set).bytes,
    rooms,
    advice: [...few, ...one],
    left_out,
    changes: set.changes
      .slice(-20)
      .reverse()
      .map((change) => told(change)),
  };
}

/** A change as the service tells it. */
function told(change) {
  const copy = { ...change };
  delete copy.before;
  delete copy.undo;
  return copy;
}

/** Changes a set, so that it can be undone. */
function change(set, action, text, count, work) {
  const before = { frames: set.frames.map((one) => ({ ...one })), rooms: [...set.rooms] };
  work();
  set.changed_at = new Date().toISOString();
  const made = {
    id: ++lastChange,
    at: set.changed_at,
    by: "admin",
    action,
    text,
    frames: count,
    undone: false,
    before,
  };
  set.changes.push(made);
  noteAudit("change", set.name, text);
  return told(made);
}

function moved(set, one, room, drive) {
  if (!set.rooms.includes(room)) set.rooms.push(room);
  one.room = room;
  one.drive = drive ?? one.drive;
  one.path = `${room}/${one.drive}/${one.path.split("/").at(-1)}`;
}

function applied(set, asked) {
  if (asked.action === "move" || asked.action === "remove") {
    const frames = set.frames.filter(({ path }) => asked.frames.includes(path));
    if (frames.length < asked.frames.length) {
      return problem(
        409,
        "conflict",
        "Some of these frames are not there any more: nothing was done.",
      );
    }
    const many = `${frames.length} ${frames.length === 1 ? "frame" : "frames"}`;
    if (asked.action === "move") {
      return json(
        200,
        change(set, "move", `Moved ${many} to ${asked.room}`, frames.length, () =>
          frames.forEach((one) => moved(set, one, asked.room, asked.drive)),
        ),
      );
    }
    return json(
      200,
      change(set, "remove", `Removed ${many}`, frames.length, () => {
        set.frames = set.frames.filter((one) => !frames.includes(one));
      }),
    );
  }
  const of = set.frames.filter(
    ({ room, drive }) =>
      room === asked.room && (asked.drive === undefined || drive === asked.drive),
  );
  if (asked.action === "rename_room") {
    return json(
      200,
      change(set, asked.action, `Renamed ${asked.room} to ${asked.to}`, of.length, () => {
        of.forEach((one) => moved(set, one, asked.to));
        set.rooms = set.rooms.filter((room) => room !== asked.room);
        if (!set.rooms.includes(asked.to)) set.rooms.push(asked.to);
      }),
    );
  }
  if (asked.action === "rename_drive") {
    return json(
      200,
      change(set, asked.action, `Renamed the drive ${asked.drive} to ${asked.to}`, of.length, () =>
        of.forEach((one) => moved(set, one, asked.room, asked.to)),
      ),
    );
  }
  return json(
    200,
    change(set, "remove_room", `Removed the room ${asked.room}`, of.length, () => {
      set.frames = set.frames.filter((one) => !of.includes(one));
      set.rooms = set.rooms.filter((room) => room !== asked.room);
    }),
  );
}

function undone(set, id) {
  const found = set.changes.find((one) => one.id === id);
  if (!found) return problem(404, "not-found", "There is no such change.");
  if (set.changes.some((one) => one.id > id && !one.undone)) {
    return problem(409, "conflict", "Later changes stand in the way: undo them first.");
  }
  Object.assign(set, { frames: found.before.frames, rooms: found.before.rooms });
  found.undone = true;
  found.undo?.();
  noteAudit("undo", set.name, found.text);
  return json(200, told(found));
}

/** The names of the files of a form, or of the one picture of a body. */
function fileNames(request, query) {
  if (!request.headers["content-type"]?.startsWith("multipart/"))
    return [query.get("name") ?? "picture.jpg"];
  return [...request.body.toString("latin1").matchAll(/filename="([^"]*)"/g)].map(([, name]) =>
    Buffer.from(name, "latin1").toString("utf8"),
  );
}

function uploaded(set, request, query) {
  if (process.env.MOCK_DISK_FULL && set.frames.length > Number(process.env.MOCK_DISK_FULL)) {
    return problem(
      507,
      "disk-full",
      "The disk of the data directory is full: make room, then go on.",
    );
  }
  const [room, drive] = [query.get("room"), query.get("drive") ?? "upload"];
  const answer = { added: [], copies: [], refused: [] };
  for (const name of fileNames(request, query)) {
    if (/\.(txt|heic|mov|csv)$/i.test(name)) {
      answer.refused.push({
        name,
        reason: "not a picture that can be read: JPEG, PNG, WebP, BMP or PGM",
      });
      continue;
    }
    const one = frame(room, drive, `${content(name + drive).slice(0, 12)}.jpg`);
    if (set.frames.some(({ path }) => path === one.path)) {
      answer.copies.push({ name, path: one.path });
      continue;
    }
    if (!set.rooms.includes(room)) set.rooms.push(room);
    set.frames.push(one);
    answer.added.push(one.path);
  }
  set.changed_at = new Date().toISOString();
  return json(200, answer);
}

function checked(set) {
  const [one, two, three, four] = [0, 40, 90, 150].map((at) => set.frames[at]).filter(Boolean);
  const finding = (oddity, heading, of, detail, more = {}) =>
    of && { oddity, heading, path: of.path, room: of.room, detail, ...more };
  set.check = {
    state: "running",
    at: new Date().toISOString(),
    n_frames: set.frames.length,
    findings: [],
  };
  setTimeout(() => {
    set.check = {
      ...set.check,
      state: "done",
      findings: [
        finding(
          "label",
          "Labels that the other pictures contradict, the surest first: look at them, and move what is wrong",
          one,
          "others say kitchen (0.91)",
          { likely_room: "kitchen" },
        ),
        finding(
          "label",
          "Labels that the other pictures contradict, the surest first: look at them, and move what is wrong",
          two,
          "others say study (0.84)",
          { likely_room: "study" },
        ),
        finding("copy", "Copies: training leaves them out", three, "", { other: four?.path }),
        finding("blurred", "Blurred", four, "sharpness 12 of 85"),
      ].filter(Boolean),
    };
  }, 4000);
  return set.check;
}

/** Adds frames that were labeled in the inbox; `undo` is done when that is undone. */
export function addLabeled(name, paths, undo) {
  const set = sets.get(name);
  if (!set) return undefined;
  const text = `Labeled ${paths.length} frames from the inbox`;
  const { id } = change(set, "label", text, paths.length, () => {
    for (const path of paths) {
      const [room, drive, file] = path.split("/");
      if (!set.rooms.includes(room)) set.rooms.push(room);
      set.frames.push(frame(room, drive, file));
    }
  });
  set.changes.at(-1).undo = undo;
  return id;
}

/** Calls below `v1/sets`. */
export function setsCall(request, url) {
  const [, , , rawName, part, id, verb] = url.pathname.split("/");
  const { method } = request;
  if (rawName === undefined) {
    return json(200, { sets: [...sets.values()].map(summary) });
  }
  const name = decodeURIComponent(rawName);
  if (method === "PUT" && part === undefined) {
    if (!/^[A-Za-z0-9._-]{1,64}$/.test(name)) {
      return problem(
        400,
        "bad-request",
        "A name has letters, digits, - _ . and at most 64 of them.",
      );
    }
    const isNew = !sets.has(name);
    if (isNew) (made(name, []), noteAudit("set_created", name, ""));
    return json(isNew ? 201 : 200, summary(sets.get(name)));
  }
  const set = sets.get(name);
  if (!set) return problem(404, "not-found", `There is no data set ${name}.`);
  if (part === undefined) {
    if (method !== "DELETE") return json(200, details(set));
    removed.set(name, set);
    sets.delete(name);
    noteAudit("set_removed", name, "");
    return { status: 204 };
  }
  const { searchParams: query } = url;
  if (part === "frames" && method === "POST") return uploaded(set, request, query);
  if (part === "frames") {
    const wanted = set.frames.filter(
      ({ room, drive }) =>
        room === (query.get("room") ?? room) && drive === (query.get("drive") ?? drive),
    );
    wanted.sort((a, b) => (a.path < b.path ? -1 : 1));
    const after = Number(query.get("after") ?? 0);
    const until = after + Number(query.get("limit") ?? 200);
    return json(200, {
      total: wanted.length,
      frames: wanted.slice(after, until),
      ...(until < wanted.length ? { next: String(until) } : {}),
    });
  }
  if (part === "picture") {
    const path = query.get("path") ?? "";
    return {
      status: 200,
      type: "image/svg+xml",
      body: picture(path.split("/")[0], path.split("/").at(-1)),
      headers: { "Cache-Control": "max-age=3600" },
    };
  }
  if (part === "changes" && verb === "undo") return undone(set, Number(id));
  if (part === "changes") return applied(set, request.json());
  if (part === "check") return method === "POST" ? json(202, checked(set)) : json(200, set.check);
  return undefined;
}
