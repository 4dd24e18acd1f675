import { expect, it } from "vitest";
import type { Evaluation, Rate } from "../../api/trainings";
import { dots, isClear, ratesByRoom, shade } from "./charts";

const rate = (n_correct: number, n_frames: number): Rate => ({
  n_correct,
  n_frames,
  rate: n_frames > 0 ? n_correct / n_frames : null,
});

const evaluation = (rates: Record<string, Rate>): Evaluation => ({
  places: Object.keys(rates),
  confusion: [],
  overall: rate(0, 0),
  by_place: Object.values(rates),
  mean_by_place: null,
});

it("rooms of several evaluations stand beside each other, also those that only one has", () => {
  const before = evaluation({ hall: rate(1, 2), bath: rate(2, 2) });
  const now = evaluation({ attic: rate(3, 4), hall: rate(2, 2) });
  expect(ratesByRoom([before, now])).toEqual([
    { room: "attic", rates: [undefined, rate(3, 4)] },
    { room: "bath", rates: [rate(2, 2), undefined] },
    { room: "hall", rates: [rate(1, 2), rate(2, 2)] },
  ]);
  expect(ratesByRoom([undefined, undefined])).toEqual([]);
});

it("a cell that is not empty can be seen", () => {
  expect([0, 1, 50, 100].map((count) => shade(count, [count, 100 - count]))).toEqual([0, 1, 3, 5]);
  expect(shade(0, [0, 0])).toBe(0);
});

it("bins lie on the diagonal where probabilities keep their word", () => {
  const [half, sure] = dots(
    [
      { probability: 0.5, rate: rate(5, 10) },
      { probability: 1, rate: rate(40, 40) },
    ],
    200,
  );
  expect(half).toMatchObject({ x: 100, y: 100, radius: 6 });
  expect(sure).toMatchObject({ x: 200, y: 0, radius: 9 });
});

it("small sets make no clear difference", () => {
  expect(isClear(rate(5, 10), rate(6, 10))).toBe(false);
  expect(isClear(rate(50, 100), rate(75, 100))).toBe(true);
  expect(isClear(rate(10, 10), rate(10, 10))).toBe(false);
  expect(isClear(undefined, rate(1, 1))).toBe(false);
});
