// What the service says of itself, and its keys.

import { json, problem } from "./answers.mjs";
import { noteAudit } from "./audit.mjs";

const N_POINTS = 360;
const INTERVAL_S = 10;
const started = new Date(Date.now() - 7_500_000).toISOString();
let keys = [
  { name: "anna", role: "admin", robots: [], from: "settings" },
  { name: "vera", role: "viewer", robots: [], made_at: started, from: "page" },
  {
    name: "vacuum",
    role: "robot",
    robots: ["robot-01", "robot-02"],
    made_at: started,
    from: "page",
  },
];

function point(at) {
  const wave = 1 + Math.sin(at / 40) / 3 + Math.random() / 8;
  const latency_ms = {
    queue: 0.4 * wave ** 4,
    decode: 2 * wave,
    features: 5.5 * wave,
    classify: 1.2 * wave,
  };
  const p50_ms = Object.values(latency_ms).reduce((sum, one) => sum + one);
  return {
    at: new Date(Date.now() - (N_POINTS - at) * INTERVAL_S * 1000).toISOString(),
    answers: Math.round(600 * wave),
    errors: at % 97 === 0 ? 3 : 0,
    refused: at > 200 && at < 215 ? 12 : 0,
    dropped: Math.round(9 * wave * Math.random()),
    unknown: Math.round(40 * wave),
    queue: Math.round(2 * wave ** 3),
    busy: 1.1 * wave,
    memory_bytes: 310e6 + at * 4e4,
    cpu_s: 11 * wave,
    latency_ms,
    p50_ms,
    p99_ms: p50_ms * 2.7,
    streams: 9,
    robots: 12,
    lost: at % 30 < 4 ? 1 : 0,
  };
}

/** Calls of `v1/service`. */
export function serviceCall(_request, url) {
  if (url.pathname.endsWith("/history")) {
    return json(200, {
      interval_s: INTERVAL_S,
      points: Array.from({ length: N_POINTS }, (_, at) => point(at)),
    });
  }
  return json(200, {
    version: "0.3.0",
    started_at: started,
    uptime_s: (Date.now() - Date.parse(started)) / 1000,
    data: !process.env.NO_DATA,
    keys: Boolean(process.env.KEYS),
    threads: 4,
    frames_kept: true,
    lost_after_s: 10,
    models_folder: "models",
    webhooks: 1,
    mqtt: false,
  });
}

/** Calls of `v1/keys`. */
export function keysCall(request, url) {
  const name = decodeURIComponent(url.pathname.split("/")[3] ?? "");
  if (request.method === "GET") return json(200, { keys });
  if (request.method === "POST") {
    const made = request.json();
    if (keys.some((key) => key.name === made.name))
      return problem(409, "conflict", `There is a key ${made.name}.`);
    keys.push({ robots: [], ...made, made_at: new Date().toISOString(), from: "page" });
    noteAudit("key_made", made.name, made.role);
    return json(201, { key: "rs_5f0c2a9be1d34c775f0c2a9be1d34c77", ...made });
  }
  if (keys.some((key) => key.name === name && key.from === "settings")) {
    return problem(409, "conflict", `The key ${name} stands in the settings; remove it there.`);
  }
  keys = keys.filter((key) => key.name !== name);
  noteAudit("key_revoked", name, "");
  return { status: 204 };
}
