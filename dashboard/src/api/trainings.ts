/** Trainings, and what they say of the model that they made. */

import { call } from "./client";

export const EFFORTS = ["fast", "default", "best"] as const;
export type Effort = (typeof EFFORTS)[number];

export const CAMERAS = ["perspective", "equirectangular", "omnidirectional"] as const;
export type Camera = (typeof CAMERAS)[number];

export interface Share {
  n_right: number;
  n_frames: number;
}

/** Beside the version that serves. */
export interface Comparison {
  serving: string;
  compared_on: "same_frames" | "own_held_out";
  before: Share;
  now: Share;
  is_worse: boolean;
}

export interface VersionName {
  name: string;
  version: number;
}

export interface Training {
  id: number;
  set: string;
  model: string;
  effort: Effort;
  state: "running" | "done" | "failed" | "cancelled";
  step?: string;
  progress?: number;
  began_at: string;
  ended_at?: string;
  by: string;
  error?: string;
  rate?: number;
  n_frames?: number;
  comparison?: Comparison;
  published?: VersionName;
  log?: string[];
  report?: Report;
}

export interface TrainingRequest {
  set: string;
  model: string;
  effort?: Effort;
  camera?: Camera;
}

export interface Rate {
  n_correct: number;
  n_frames: number;
  rate: number | null;
}

/** Held-out answers, counted. */
export interface Evaluation {
  places: string[];
  /** How often each room (row) was answered as each room (column). */
  confusion: number[][];
  overall: Rate;
  by_place: Rate[];
  mean_by_place: number | null;
}

/** Answers of about the same probability. */
export interface Bin {
  probability: number;
  rate: Rate;
}

/** What the word "known" is worth. */
export interface Knowledge {
  known: Rate;
  right_known: Rate;
  new_unknown: Rate;
  auroc: number | null;
  calibration_error: number | null;
  reliability: Bin[];
}

export interface WeakRoom {
  room: string;
  rate: number;
  n_frames: number;
  n_more?: number;
}

export interface Confused {
  shown: string;
  answered: string;
  n_frames: number;
}

export interface Verdict {
  guessing: number;
  is_better_than_guessing: boolean | null;
  knowledge: Knowledge;
  knows: boolean;
  learning_curve?: { rate_of_half: number; rate_of_all: number };
  confused: Confused[];
  weak_rooms: WeakRoom[];
  rooms_of_one_drive: string[];
}

export interface Tally {
  name: string;
  opinions: string[];
  n_right: number;
  n_frames: number;
}

/** What a person would ask about a model. */
export interface Card {
  description: string;
  simulated: boolean;
  trained_by: string;
  n_frames: number;
  sequences: string[];
  measured: { data: string; n_frames: number; rate: number }[];
  choice?: { chosen: number; tallies: Tally[] };
  additions?: { sequence: string; n_frames: number }[];
}

export interface NotHeldOut {
  reason: string;
  n_frames: number;
  rooms: string[];
}

/** What `roomsight train --json` prints. */
export interface Report {
  card: Card;
  held_out: Evaluation;
  not_held_out: NotHeldOut[];
  verdict: Verdict;
  comparison?: Comparison;
}

export const listTrainings = async (signal?: AbortSignal) =>
  (await call<{ trainings: Training[] }>("v1/trainings", { signal })).trainings;

export const getTraining = (id: number, signal?: AbortSignal) =>
  call<Training>(`v1/trainings/${id}`, { signal });

export const startTraining = (training: TrainingRequest) =>
  call<Training>("v1/trainings", { method: "POST", json: training });

export const cancelTraining = (id: number) =>
  call<Training>(`v1/trainings/${id}/cancel`, { method: "POST" });

/** Makes what was trained the next version of its model, which serves nobody yet. */
export const publishTraining = (id: number, even_if_worse = false) =>
  call<VersionName>(`v1/trainings/${id}/publish`, { method: "POST", json: { even_if_worse } });
