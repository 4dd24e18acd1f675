/** What the charts of a model's card draw. */

import type { Bin, Evaluation, Rate } from "../../api/trainings";

/** A room's rates in several evaluations, in their order. */
export interface RoomRates {
  room: string;
  rates: (Rate | undefined)[];
}

/** The rates of every room that any of the evaluations has, by name. */
export function ratesByRoom(evaluations: readonly (Evaluation | undefined)[]): RoomRates[] {
  const rooms = new Set(evaluations.flatMap((evaluation) => evaluation?.places ?? []));
  const rate = (evaluation: Evaluation | undefined, room: string) =>
    evaluation?.by_place[evaluation.places.indexOf(room)];
  return [...rooms]
    .sort((a, b) => a.localeCompare(b))
    .map((room) => ({ room, rates: evaluations.map((evaluation) => rate(evaluation, room)) }));
}

/** How dark a cell of a confusion matrix is, 0 to 5, by its share of the row. */
export function shade(count: number, row: readonly number[]): number {
  const total = row.reduce((sum, value) => sum + value, 0);
  return count === 0 ? 0 : Math.max(1, Math.round((5 * count) / total));
}

export interface Dot {
  x: number;
  y: number;
  radius: number;
  bin: Bin;
}

/** Where the bins of a reliability diagram lie in a square of `side`: the more frames, the larger. */
export function dots(bins: readonly Bin[], side: number): Dot[] {
  const most = Math.max(...bins.map((bin) => bin.rate.n_frames), 1);
  return bins.map((bin) => ({
    x: bin.probability * side,
    y: (1 - (bin.rate.rate ?? 0)) * side,
    radius: 3 + 6 * Math.sqrt(bin.rate.n_frames / most),
    bin,
  }));
}

/** A difference of two rates that chance does not explain: more than two standard errors apart. */
export function isClear(before: Rate | undefined, now: Rate | undefined): boolean {
  if (before?.rate == null || now?.rate == null) {
    return false;
  }
  const variance = ({ rate, n_frames }: Rate) =>
    ((rate ?? 0) * (1 - (rate ?? 0))) / Math.max(n_frames, 1);
  const error = Math.sqrt(variance(before) + variance(now));
  return Math.abs(now.rate - before.rate) > Math.max(2 * error, 0.001);
}
