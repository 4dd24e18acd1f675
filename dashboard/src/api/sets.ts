/** Data sets: rooms with their drives and frames, what is odd about them, and what was changed. */

import { address, call, part } from "./client";

export interface SetSummary {
  name: string;
  rooms: number;
  frames: number;
  bytes: number;
  changed_at?: string;
}

export interface Drive {
  name: string;
  frames: number;
}

export interface Room {
  name: string;
  frames: number;
  drives: Drive[];
}

/** Something that was done to a data set. */
export interface Change {
  id: number;
  at: string;
  by: string;
  action: string;
  text: string;
  frames: number;
  undone: boolean;
}

export interface LeftOut {
  path: string;
  reason: string;
}

export interface DataSet {
  name: string;
  bytes: number;
  rooms: Room[];
  advice: string[];
  left_out: LeftOut[];
  changes: Change[];
}

/** A frame, named by its path in the set. */
export interface Frame {
  path: string;
  room: string;
  drive: string;
  bytes: number;
}

export interface FramePage {
  total: number;
  frames: Frame[];
  next?: string;
}

export interface Refused {
  name: string;
  reason: string;
}

/** What became of uploaded pictures. */
export interface Added {
  added: string[];
  copies: { name: string; path: string }[];
  refused: Refused[];
  change?: number;
}

export type ChangeRequest =
  | { action: "move"; frames: string[]; room: string; drive?: string }
  | { action: "remove"; frames: string[] }
  | { action: "rename_room"; room: string; to: string }
  | { action: "rename_drive"; room: string; drive: string; to: string }
  | { action: "remove_room"; room: string };

export interface Finding {
  oddity: string;
  heading: string;
  path: string;
  room: string;
  detail: string;
  /** The picture that it is a copy of. */
  other?: string;
  /** The room that it shows more likely. */
  likely_room?: string;
}

/** An examination of a set. */
export interface Check {
  state: "none" | "running" | "done" | "failed";
  at?: string;
  error?: string;
  n_frames?: number;
  findings: Finding[];
}

/** The room of pictures of no room. */
export const ELSEWHERE = "elsewhere";

/** The address of a picture of a data set; without a width the file itself. */
export const pictureAddress = (set: string, path: string, width?: number) =>
  address(`v1/sets/${part(set)}/picture`, { path, width });

const setPath = (set: string) => `v1/sets/${part(set)}`;

export const listSets = (signal?: AbortSignal) =>
  call<{ sets: SetSummary[] }>("v1/sets", { signal });

export const createSet = (set: string) => call<SetSummary>(setPath(set), { method: "PUT" });

export const removeSet = (set: string) => call<void>(setPath(set), { method: "DELETE" });

export const getSet = (set: string, signal?: AbortSignal) =>
  call<DataSet>(setPath(set), { signal });

export interface FrameQuery {
  room?: string;
  drive?: string;
}

export const listFrames = (
  set: string,
  query: FrameQuery,
  after: string | undefined,
  limit: number,
  signal?: AbortSignal,
) =>
  call<FramePage>(`${setPath(set)}/frames`, {
    query: { room: query.room, drive: query.drive, after, limit },
    signal,
  });

/** Adds pictures to a drive through a room. */
export function addFrames(
  set: string,
  room: string,
  drive: string,
  pictures: { name: string; picture: Blob }[],
  signal?: AbortSignal,
): Promise<Added> {
  const body = new FormData();
  for (const { name, picture } of pictures) body.append("frame", picture, name);
  return call<Added>(`${setPath(set)}/frames`, {
    method: "POST",
    query: { room, drive },
    body,
    signal,
  });
}

export const changeSet = (set: string, change: ChangeRequest) =>
  call<Change>(`${setPath(set)}/changes`, { method: "POST", json: change });

export const undoChange = (set: string, change: number) =>
  call<Change>(`${setPath(set)}/changes/${change}/undo`, { method: "POST" });

export const startCheck = (set: string) => call<Check>(`${setPath(set)}/check`, { method: "POST" });

export const getCheck = (set: string, signal?: AbortSignal) =>
  call<Check>(`${setPath(set)}/check`, { signal });
