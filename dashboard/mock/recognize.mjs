// Answers to frames, whatever they show.

import { json } from "./answers.mjs";
import { MODEL, ROOMS } from "./robots.mjs";

let n_frames = 0;

export function answer(explain) {
  n_frames += 1;
  const at = Math.floor(n_frames / 20) % ROOMS.length;
  const sure = 0.55 + 0.4 * Math.abs(Math.sin(n_frames / 13));
  const others = ROOMS.filter((_, n) => n !== at).map((room, n) => ({
    room,
    probability: ((1 - sure) * 2 ** -n) / 1.9375,
  }));
  const known = sure > 0.7;
  return {
    room: ROOMS[at],
    probability: sure,
    probabilities: [{ room: ROOMS[at], probability: sure }, ...others],
    known,
    unknown: known ? undefined : "unsure",
    novelty: 0.1,
    model: { ...MODEL, epoch: 4, digest: "5f0c2a9be1d34c77" },
    keypoints: 182,
    timings_ms: { queue: 0.1, decode: 2.1, features: 6.4, classify: 1.2 },
    request_id: `mock-${n_frames}`,
    ...(explain ? explained(ROOMS[at]) : {}),
  };
}

function explained(room) {
  const evidence = Array.from({ length: 80 }, () => ({
    x: Math.random() * 320,
    y: Math.random() * 240,
    weight: Math.random() * 2 - 0.7,
    opinion: "bag",
    word: 12,
  }));
  const near = (opinion, n) => ({
    opinion,
    frame: `kitchen/monday/${n}.jpg`,
    drive: "monday",
    room: n === 2 ? "hall" : room,
    nearness: 0.92 - n * 0.1,
    points: [
      [100 + n * 10, 90],
      [140, 120],
    ],
  });
  const nearest = [0, 1, 2].flatMap((n) => [near("bag", n), near("vector", n)]);
  return { evidence, nearest, pose: { x: 2.1, y: 1.4, angle: 0.7, radius: 0.6 } };
}

/** The call `v1/recognize`. */
export const recognizeCall = (_request, url) => json(200, answer(url.searchParams.has("explain")));
