import type { History, HistoryPoint } from "../../api/service";
import { STAGES } from "../../components/timings";
import { text as common } from "../../texts/common";
import { text } from "../../texts/service";

/** One line of a chart. */
export interface Line {
  label: string;
  /** Which color of `src/styles/tokens.css`, such as `accent`, or the number of a room's. */
  color: string;
  values: (number | null)[];
  /** Drawn on top of the lines before it, the space between filled. */
  stacked?: boolean;
}

export interface ChartData {
  id: string;
  title: string;
  unit: string;
  digits: number;
  /** Seconds since 1970. */
  times: number[];
  lines: Line[];
}

const MIB = 1024 * 1024;

/** The points in order of time: where a clock was set back, only what came after that counts. */
export function inOrder(points: readonly HistoryPoint[]): HistoryPoint[] {
  const kept: HistoryPoint[] = [];
  let next = Infinity;
  for (const point of points.toReversed()) {
    const at = Date.parse(point.at);
    if (!(at < next)) break;
    next = at;
    kept.push(point);
  }
  return kept.reverse();
}

/** All charts of the service. */
export function chartsOf({ interval_s, points: told }: History): ChartData[] {
  const points = inOrder(told);
  const times = points.map(({ at }) => Date.parse(at) / 1000);
  const of = (value: (point: HistoryPoint) => number | null) => points.map(value);
  const rate = (value: (point: HistoryPoint) => number) => of((p) => value(p) / interval_s);
  const { charts, series, units } = text;
  const chart = (id: keyof typeof charts, unit: string, digits: number, lines: Line[]) => ({
    id,
    title: charts[id],
    unit,
    digits,
    times,
    lines,
  });
  return [
    chart("throughput", units.perSecond, 1, [
      { label: series.answers, color: "room-0", values: rate((p) => p.answers) },
    ]),
    chart("percentiles", units.ms, 1, [
      { label: series.p50, color: "room-0", values: of((p) => p.p50_ms) },
      { label: series.p99, color: "room-1", values: of((p) => p.p99_ms) },
    ]),
    chart(
      "latency",
      units.ms,
      1,
      STAGES.map(({ id, color }) => ({
        label: common.stages[id],
        color: `room-${color}`,
        values: of((p) => p.latency_ms[id]),
        stacked: true,
      })),
    ),
    chart("trouble", units.perSecond, 1, [
      { label: series.dropped, color: "room-6", values: rate((p) => p.dropped) },
      { label: series.refused, color: "room-2", values: rate((p) => p.refused) },
      { label: series.errors, color: "room-9", values: rate((p) => p.errors) },
    ]),
    chart("answers", units.share, 0, [
      {
        label: series.unknown,
        color: "room-1",
        values: of((p) => (p.answers > 0 ? (100 * p.unknown) / p.answers : null)),
      },
    ]),
    chart("queue", units.count, 1, [
      { label: series.queue, color: "room-6", values: of((p) => p.queue) },
      { label: series.busy, color: "room-0", values: of((p) => p.busy) },
    ]),
    chart("robots", units.count, 0, [
      { label: series.robots, color: "room-0", values: of((p) => p.robots) },
      { label: series.streams, color: "room-5", values: of((p) => p.streams) },
      { label: series.lost, color: "room-9", values: of((p) => p.lost) },
    ]),
    chart("memory", units.memory, 0, [
      { label: series.memory, color: "room-2", values: of((p) => p.memory_bytes / MIB) },
    ]),
    chart("cpu", units.cores, 2, [
      { label: series.cpu, color: "room-3", values: rate((p) => p.cpu_s) },
    ]),
  ];
}
