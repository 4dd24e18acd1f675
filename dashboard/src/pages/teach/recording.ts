/** Which frames of a camera are taken while somebody walks through a room, and when they are enough. */

import { difference, type View } from "./view";

/** A room can be told by so many different frames. */
export const ENOUGH = 40;
/** More than these hardly help. */
export const PLENTY = 120;

/** A view is another one where it differs from all that were taken by at least this. */
const OTHER_VIEW = 0.12;
/** Darker frames show nothing. */
const LEAST_BRIGHTNESS = 18;
/** Frames less sharp than this share of the middle one of the last are blurred. */
const LEAST_SHARPNESS = 0.5;
/** So many frames tell how sharp this camera is in this room. */
const REMEMBERED = 30;

/** Why a frame was taken, or was not. */
export type Decision = "taken" | "same" | "blurred" | "dark" | "plenty";

/** What was taken so far. Not changed; `considered` makes the next. */
export interface Recording {
  readonly taken: readonly View[];
  /** How sharp the last frames were. */
  readonly sharpness: readonly number[];
  /** What became of the last frame. */
  readonly last?: Decision;
}

export const EMPTY: Recording = { taken: [], sharpness: [] };

function middle(values: readonly number[]): number {
  const sorted = [...values].sort((a, b) => a - b);
  return sorted[Math.floor(sorted.length / 2)] ?? 0;
}

function decide(recording: Recording, view: View): Decision {
  if (recording.taken.length >= PLENTY) {
    return "plenty";
  }
  if (view.brightness < LEAST_BRIGHTNESS) {
    return "dark";
  }
  if (view.sharpness < LEAST_SHARPNESS * middle(recording.sharpness)) {
    return "blurred";
  }
  return recording.taken.some((taken) => difference(taken, view) < OTHER_VIEW) ? "same" : "taken";
}

/** After a frame was looked at. */
export function considered(
  recording: Recording,
  view: View,
): Recording & { readonly last: Decision } {
  const last = decide(recording, view);
  return {
    taken: last === "taken" ? [...recording.taken, view] : recording.taken,
    sharpness: [...recording.sharpness, view.sharpness].slice(-REMEMBERED),
    last,
  };
}

/** How far a recording is: 0 to 1 until it is enough. */
export function progress(frames: number): number {
  return Math.min(frames / ENOUGH, 1);
}

const twoDigits = (value: number) => String(value).padStart(2, "0");

/** The drive of a recording, by the clock on the wall: `2025-11-27-0914-05`. */
export function driveName(at: Date): string {
  const day = [at.getFullYear(), twoDigits(at.getMonth() + 1), twoDigits(at.getDate())].join("-");
  return `${day}-${twoDigits(at.getHours())}${twoDigits(at.getMinutes())}-${twoDigits(at.getSeconds())}`;
}
