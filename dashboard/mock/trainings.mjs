// Trainings that take half a minute.

import { json, problem } from "./answers.mjs";
import { noteAudit } from "./audit.mjs";
import { addVersion, servingOf } from "./models.mjs";
import { report } from "./report.mjs";

const TAKES_MS = Number(process.env.TRAINING_MS ?? 25_000);
const STEPS = [
  "reading pictures",
  "describing pictures",
  "trying opinions",
  "training",
  "measuring",
];

const ago = (minutes) => new Date(Date.now() - minutes * 60_000).toISOString();

function finished(id, minutes, quality, version) {
  const made = report(quality, 340);
  return {
    id,
    set: "home",
    model: "home",
    effort: "default",
    state: "done",
    progress: 1,
    began_at: ago(minutes),
    ended_at: ago(minutes - 3),
    by: "admin",
    rate: made.held_out.overall.rate,
    n_frames: 340,
    published: { name: "home", version },
    log: ["340 frames of 5 rooms", "chosen: network"],
    report: made,
  };
}

const trainings = [
  {
    id: 4,
    set: "strange names",
    model: "home",
    effort: "fast",
    state: "failed",
    began_at: ago(80),
    ended_at: ago(80),
    by: "admin",
    error: "every frame shows Küche & Flur: add frames of at least one other room",
    log: [
      "14 frames",
      "failed: every frame shows Küche & Flur: add frames of at least one other room",
    ],
  },
  finished(3, 200, 0.91, 3),
  finished(2, 1600, 0.84, 2),
  finished(1, 4000, 0.72, 1),
];

function comparisonOf(model, made, isWorse) {
  const serving = servingOf(model);
  if (serving === undefined) return undefined;
  const { n_frames, n_correct } = made.held_out.overall;
  const before = { n_right: n_correct + (isWorse ? 40 : -22), n_frames };
  return {
    serving: `${model}/${serving}`,
    compared_on: "same_frames",
    before,
    now: { n_right: n_correct, n_frames },
    is_worse: isWorse,
  };
}

function advance(training, began) {
  if (training.state !== "running") return;
  const progress = (Date.now() - began) / TAKES_MS;
  if (progress < 1) {
    training.progress = progress;
    training.step = STEPS[Math.floor(progress * STEPS.length)];
    if (!training.log.at(-1)?.startsWith(training.step)) training.log.push(`${training.step} ...`);
    setTimeout(() => advance(training, began), 300);
    return;
  }
  const isWorse = training.effort === "fast";
  const made = report(isWorse ? 0.7 : 0.95, 368);
  const comparison = comparisonOf(training.model, made, isWorse);
  Object.assign(training, {
    state: "done",
    progress: 1,
    step: undefined,
    ended_at: ago(0),
    rate: made.held_out.overall.rate,
    n_frames: 368,
    comparison,
    report: { ...made, comparison },
  });
}

function started(asked) {
  if (trainings.some(({ state }) => state === "running")) {
    return problem(409, "conflict", "Another training runs: wait for it, or cancel it.");
  }
  const training = {
    id: trainings[0].id + 1,
    ...asked,
    effort: asked.effort ?? "default",
    state: "running",
    progress: 0,
    began_at: ago(0),
    by: "admin",
    log: [`training on ${asked.set}`],
  };
  trainings.unshift(training);
  noteAudit("train", asked.model, `on ${asked.set}`);
  advance(training, Date.now());
  return json(202, training);
}

function summary(training) {
  const copy = { ...training };
  delete copy.log;
  delete copy.report;
  return copy;
}

/** Calls below `v1/trainings`. */
export function trainingsCall(request, url) {
  const [, , , id, verb] = url.pathname.split("/");
  if (id === undefined) {
    return request.method === "POST"
      ? started(request.json())
      : json(200, { trainings: trainings.map(summary) });
  }
  const training = trainings.find((one) => one.id === Number(id));
  if (!training) return problem(404, "not-found", "There is no such training.");
  if (verb === "cancel") {
    if (training.state === "running")
      Object.assign(training, { state: "cancelled", ended_at: ago(0) });
    noteAudit("cancel", training.model, `training ${id}`);
    return json(200, summary(training));
  }
  if (verb === "publish") {
    if (training.comparison?.is_worse && !request.json().even_if_worse) {
      return problem(
        409,
        "conflict",
        "It answers fewer frames right than the version that serves.",
      );
    }
    training.published = {
      name: training.model,
      version: addVersion(training.model, training.report.card),
    };
    noteAudit("publish", `${training.model}/${training.published.version}`, `training ${id}`);
    return json(201, training.published);
  }
  return json(200, training);
}
