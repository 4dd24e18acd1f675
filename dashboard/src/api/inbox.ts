/** Frames that robots sent and the model doubted, or that somebody says were answered wrong. */

import { address, call, fetchFrom } from "./client";
import type { RoomProbability, Unknown } from "./recognize";
import type { Camera, Effort } from "./trainings";

export const REASONS = ["unknown", "low", "torn", "filter_apart", "shadow_apart", "wrong"] as const;
export type Reason = (typeof REASONS)[number];

/** Where a frame went that somebody labeled. */
export interface FrameLabel {
  set: string;
  room: string;
  path: string;
  by: string;
  at: string;
}

export interface InboxFrame {
  id: number;
  at: string;
  robot?: string;
  key?: string;
  room: string;
  known: boolean;
  unknown?: Unknown;
  probability: number;
  probabilities: RoomProbability[];
  novelty?: number;
  filtered_room?: string;
  shadow_room?: string;
  reasons: Reason[];
  /** How much it would teach, 0 to 1. */
  value: number;
  model: { name: string; version: number };
  revision: number;
  label?: FrameLabel;
  /** The room that a person says it is. */
  said?: string;
}

export interface InboxPage {
  total: number;
  open: number;
  frames: InboxFrame[];
  next?: number;
}

export interface InboxQuery {
  state: "open" | "labeled" | "all";
  reason?: Reason;
  robot?: string;
  room?: string;
  sort: "value" | "newest";
}

/** Of whom frames are kept, and for how long. */
export interface RuleSettings {
  all: boolean;
  robots: string[];
  keys: string[];
  every_s: number;
  probability: number;
  max_frames: number;
  max_bytes: number;
  max_days: number;
}

export interface Rule extends RuleSettings {
  frames: number;
  bytes: number;
  /** Frames that could not be kept since the service started. */
  missed?: number;
}

/** A frame as somebody saw it: a label is refused where it has changed since. */
export interface Seen {
  id: number;
  revision: number;
}

export interface Conflict {
  id: number;
  label?: FrameLabel;
  reason: string;
}

export interface Labeled {
  labeled: InboxFrame[];
  conflicts: Conflict[];
  /** The changes of the data set, to undo them. */
  changes: number[];
}

export const STEPS = ["nothing", "shadow", "canary", "stable"] as const;

/** What happens by itself once frames were labeled. */
export interface Policy {
  set?: string;
  model?: string;
  effort: Effort;
  camera?: Camera;
  /** 0: never. */
  train_after: number;
  /** How far a trained version goes by itself. */
  publish: (typeof STEPS)[number];
}

/** What a person corrected: the frame goes to the inbox. */
export interface Correction {
  frame: Blob;
  /** What it is, where the person knows. */
  right?: string;
  robot?: string;
}

export const sendCorrection = ({ frame, right, robot }: Correction) =>
  call<InboxFrame>("v1/inbox", {
    method: "POST",
    body: frame,
    headers: { "Content-Type": frame.type || "image/jpeg" },
    query: { robot, right },
  });

export const getRule = (signal?: AbortSignal) => call<Rule>("v1/inbox/rule", { signal });

export const putRule = (rule: RuleSettings) =>
  call<Rule>("v1/inbox/rule", { method: "PUT", json: rule });

export const listInbox = (
  query: InboxQuery,
  after: string | undefined,
  limit: number,
  signal?: AbortSignal,
) => call<InboxPage>("v1/inbox", { query: { ...query, after, limit }, signal });

/** The address of a frame's picture, at most `width` wide where it is given. */
export const inboxPicture = (id: number, width?: number) =>
  address(`v1/inbox/${id}/picture`, { width });

export async function inboxBlob(id: number, signal?: AbortSignal): Promise<Blob> {
  const response = await fetchFrom(`v1/inbox/${id}/picture`, { signal });
  return response.blob();
}

/** So many frames are named in a request. */
const AT_ONCE = 500;

function parts(frames: readonly Seen[]): Seen[][] {
  const count = Math.ceil(frames.length / AT_ONCE);
  return Array.from({ length: count }, (_, at) => frames.slice(at * AT_ONCE, (at + 1) * AT_ONCE));
}

interface LabeledPart {
  labeled: InboxFrame[];
  conflicts: Conflict[];
  change?: number;
}

/** Says which room frames show: they come into a data set. */
export async function labelFrames(set: string, room: string, frames: Seen[]): Promise<Labeled> {
  const all: Labeled = { labeled: [], conflicts: [], changes: [] };
  for (const part of parts(frames)) {
    const json = { set, room, frames: part };
    const done = await call<LabeledPart>("v1/inbox/labels", { method: "POST", json });
    all.labeled.push(...done.labeled);
    all.conflicts.push(...done.conflicts);
    if (done.change !== undefined) all.changes.push(done.change);
  }
  return all;
}

/** Deletes frames; how many went. */
export async function discardFrames(frames: Seen[]): Promise<number> {
  let all = 0;
  for (const part of parts(frames)) {
    const json = { frames: part };
    const done = await call<{ discarded: number }>("v1/inbox/discard", { method: "POST", json });
    all += done.discarded;
  }
  return all;
}

export const getPolicy = (signal?: AbortSignal) => call<Policy>("v1/inbox/policy", { signal });

export const putPolicy = (policy: Policy) =>
  call<Policy>("v1/inbox/policy", { method: "PUT", json: policy });
