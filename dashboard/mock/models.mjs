// Models, and how the rooms of one lie to each other.

import { json, problem } from "./answers.mjs";
import { noteAudit } from "./audit.mjs";
import { report } from "./report.mjs";
import { DOORS, MODEL, ROOMS } from "./robots.mjs";

const CORNERS = {
  hall: [4, 3],
  kitchen: [0, 0],
  "living room": [0, 4],
  bath: [8, 0],
  bedroom: [8, 4],
  study: [0, 9],
};

const at = () => new Date().toISOString();

function version(number, more = {}) {
  return {
    version: number,
    state: "ready",
    labels: [],
    history: [
      { state: "verifying", at: at() },
      { state: "ready", at: at() },
    ],
    rooms: ROOMS,
    epoch: number + 1,
    digest: `${number}f0c2a9be1d34c77`.repeat(4),
    card: report(0.6 + number / 10, 340).card,
    ...more,
  };
}

const failure = {
  stage: "verifying",
  reason: "golden frame kitchen.jpeg was answered with hall",
};
const models = new Map([
  [
    MODEL.name,
    {
      name: MODEL.name,
      epoch: 4,
      serving: 3,
      before: 2,
      default: true,
      versions: [
        version(4, { state: "failed", failure, history: [{ state: "failed", at: at() }] }),
        version(3, { labels: ["stable"] }),
        version(2, { labels: ["previous"] }),
        version(1, { state: "unloaded", history: [{ state: "unloaded", at: at() }] }),
      ],
    },
  ],
]);

/** The version of a model that serves. */
export const servingOf = (name) => models.get(name)?.serving;

/** Adds a version, and says which it is. */
export function addVersion(name, card) {
  if (!models.has(name)) models.set(name, { name, epoch: 0, versions: [] });
  const model = models.get(name);
  const number = 1 + Math.max(0, ...model.versions.map((one) => one.version));
  const state = "discovered";
  const history = [{ state, at: at() }];
  model.versions.unshift(version(number, { card, state, history }));
  return number;
}

function told(model) {
  const versions = model.versions.map((one) => {
    const copy = { ...one };
    delete copy.card;
    return copy;
  });
  const copy = { ...model, versions };
  delete copy.before;
  return copy;
}

function serve(model, number) {
  model.before = model.serving;
  model.serving = number;
  for (const one of model.versions) {
    one.labels = one.labels.filter((label) => label !== "stable" && label !== "previous");
    if (one.version === model.before) one.labels.push("previous");
  }
  const one = model.versions.find(({ version }) => version === number);
  Object.assign(one, { labels: ["stable"], state: "ready" });
  delete one.share;
  delete one.shadow;
}

function put(model, label, asked) {
  for (const one of model.versions) one.labels = one.labels.filter((other) => other !== label);
  if (!asked) return;
  const one = model.versions.find(({ version }) => version === asked.version);
  Object.assign(one, { labels: [...one.labels, label], state: "ready" });
  if (label === "canary") one.share = asked.share;
  else one.shadow = { compared: 0, agreed: 0, skipped: 0 };
}

// Shadows see frames all the time.
setInterval(() => {
  for (const { versions } of models.values()) {
    for (const { labels, shadow } of versions) {
      if (!labels.includes("shadow")) continue;
      shadow.compared += 10;
      shadow.agreed += 9;
      shadow.mean_distance = 0.12;
    }
  }
}, 1000).unref();

function changed(request, model, part, id, verb) {
  const { method } = request;
  if (part === "rollback") {
    if (model.before === undefined) {
      return problem(409, "conflict", "Nothing served before this version.");
    }
    serve(model, model.before);
    noteAudit("rollback", model.name, `to ${model.serving}`);
  } else if (part === "default") {
    for (const one of models.values()) delete one.default;
    model.default = true;
    noteAudit("default", model.name, "");
  } else if (part === "labels") {
    put(model, id, method === "DELETE" ? undefined : request.json());
    noteAudit(method === "DELETE" ? "unlabel" : "label", model.name, id);
  } else if (verb === "activate") {
    serve(model, Number(id));
    noteAudit("activate", `${model.name}/${id}`, "");
  } else if (method === "DELETE") {
    model.versions = model.versions.filter((one) => one.version !== Number(id));
    noteAudit("delete_version", `${model.name}/${id}`, "");
    return { status: 204 };
  }
  model.epoch += 1;
  return json(200, told(model));
}

/** Calls of `v1/models`. */
export function modelsCall(request, url) {
  const [, , , name, part, id, verb] = url.pathname.split("/");
  if (name === undefined) {
    const all = [...models.values()].map(told);
    return json(200, { default: all.find((one) => one.default)?.name, models: all });
  }
  const model = models.get(decodeURIComponent(name));
  if (!model) return problem(404, "not-found", `There is no model ${name}.`);
  if (request.method === "GET") {
    if (part === undefined) return json(200, told(model));
    const one = model.versions.find((other) => other.version === Number(id));
    return one ? json(200, one) : problem(404, "not-found", "There is no such version.");
  }
  const expected = request.headers["if-match"]?.replaceAll('"', "");
  if (expected !== undefined && Number(expected) !== model.epoch) {
    return problem(412, "stale-epoch", `The epoch is ${model.epoch}: look again at what serves.`);
  }
  return changed(request, model, part, id, verb);
}

/** The call `v1/models/NAME/versions/VERSION/map`. */
export function mapCall() {
  const transitions = Object.entries(DOORS).flatMap(([from, doors]) =>
    doors.map((to) => ({ from, to, rate: 1 / doors.length })),
  );
  const positions = Object.entries(CORNERS).flatMap(([room, [x, y]]) =>
    Array.from({ length: 60 }, (_, n) => ({
      room,
      x: x + (n % 10) / 3,
      y: y + Math.floor(n / 10) / 2,
    })),
  );
  return json(200, { rooms: ROOMS, transitions, positions });
}
