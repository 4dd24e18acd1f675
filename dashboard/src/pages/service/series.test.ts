import { expect, it } from "vitest";
import type { HistoryPoint } from "../../api/service";
import { chartsOf, inOrder } from "./series";

const point = (at: string, answers = 100): HistoryPoint => ({
  at,
  answers,
  errors: 0,
  refused: 0,
  dropped: 5,
  unknown: 10,
  queue: 1,
  busy: 1,
  memory_bytes: 1024 * 1024,
  cpu_s: 5,
  latency_ms: { queue: 1, decode: 2, features: 3, classify: 4 },
  p50_ms: 10,
  p99_ms: 20,
  streams: 1,
  robots: 1,
  lost: 0,
});

it("counts by the second, and says nothing of answers where there are none", () => {
  const points = [point("2026-01-01T00:00:00Z"), point("2026-01-01T00:00:10Z", 0)];
  const charts = chartsOf({ interval_s: 10, points });
  const values = (id: string) =>
    charts.find((chart) => chart.id === id)?.lines.map((line) => line.values);
  expect(values("throughput")).toEqual([[10, 0]]);
  expect(values("answers")).toEqual([[10, null]]);
  expect(values("cpu")).toEqual([[0.5, 0.5]]);
});

it("forgets what lies before a clock that was set back", () => {
  const points = ["00:00:50", "00:01:00", "00:00:10", "00:00:20"].map((time) =>
    point(`2026-01-01T${time}Z`),
  );
  expect(inOrder(points).map(({ at }) => at.slice(17, 19))).toEqual(["10", "20"]);
});
