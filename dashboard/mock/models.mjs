// Models, and how the rooms of one lie to each other.

import { json } from "./answers.mjs";
import { DOORS, MODEL, ROOMS } from "./robots.mjs";

const CORNERS = {
  hall: [4, 3],
  kitchen: [0, 0],
  "living room": [0, 4],
  bath: [8, 0],
  bedroom: [8, 4],
  study: [0, 9],
};

/** Calls of `v1/models`. */
export function modelsCall(_request, url) {
  if (url.pathname !== "/v1/models") return undefined;
  const at = new Date().toISOString();
  const versions = [3, 2, 1].map((version) => ({
    version,
    state: version > 1 ? "ready" : "unloaded",
    labels: version === 3 ? ["stable"] : [],
    history: [{ state: "ready", at }],
    rooms: ROOMS,
    epoch: version + 1,
  }));
  const failed = {
    version: 4,
    state: "failed",
    labels: [],
    history: [{ state: "failed", at }],
    failure: { stage: "verifying", reason: "golden frame kitchen.jpeg was answered with hall" },
  };
  return json(200, {
    default: MODEL.name,
    models: [
      { name: MODEL.name, epoch: 4, serving: 3, default: true, versions: [failed, ...versions] },
    ],
  });
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
