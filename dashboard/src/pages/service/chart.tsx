import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import uPlot from "uplot";
import "uplot/dist/uPlot.min.css";
import { decimal, timeOfDay } from "../../format";
import { text } from "../../texts/service";
import { theme } from "../../theme";
import type { ChartData, Line } from "./series";

const HEIGHT_PX = 170;

/** What a color of the style sheet is now, in a form that a canvas reads. */
function colorOf(element: Element, name: string): string {
  const probe = document.createElement("span");
  if (name.startsWith("room-")) {
    probe.className = name;
    probe.style.color = "var(--room)";
  } else probe.style.color = `var(--${name})`;
  element.append(probe);
  const { color } = getComputedStyle(probe);
  probe.remove();
  return color;
}

/** The values to draw: stacked lines lie on those before them. */
function drawnValues(lines: Line[]): (number | null)[][] {
  let below: (number | null)[] | undefined;
  return lines.map(({ values, stacked }) => {
    if (!stacked) return values;
    const drawn = values.map((value, at) => (value ?? 0) + (below?.[at] ?? 0));
    below = drawn;
    return drawn;
  });
}

function optionsOf(element: Element, data: ChartData): uPlot.Options {
  const muted = colorOf(element, "muted");
  const line = colorOf(element, "line");
  const font = `12px ${getComputedStyle(element).fontFamily}`;
  const isStacked = data.lines.some(({ stacked }) => stacked);
  const axis: uPlot.Axis = {
    stroke: muted,
    font,
    grid: { stroke: line, width: 1 },
    ticks: { stroke: line, width: 1, size: 4 },
  };
  return {
    width: element.clientWidth,
    height: HEIGHT_PX,
    cursor: { sync: { key: "service" }, points: { size: 7 }, drag: { x: false, y: false } },
    legend: { show: false },
    padding: [8, 8, 0, 0],
    scales: { y: { range: (_plot, _least, most) => [0, Math.max(most * 1.1, 0.001)] } },
    axes: [
      {
        ...axis,
        size: 28,
        values: (_plot, splits) =>
          splits.map((at) => timeOfDay(new Date(at * 1000).toISOString()).slice(0, 5)),
      },
      {
        ...axis,
        size: 46,
        space: 28,
        values: (_plot, splits) => splits.map((value) => `${value}`),
      },
    ],
    series: [
      {},
      ...data.lines.map(({ label, color }) => {
        const stroke = colorOf(element, color);
        const fill = isStacked ? stroke : undefined;
        return { label, stroke, fill, width: 1.75, points: { show: false } };
      }),
    ],
    // Below a stacked line lies the one before it, which is filled down to the one before that.
    bands: isStacked ? data.lines.slice(1).map((_, at) => ({ series: [at + 2, at + 1] })) : [],
  };
}

/** A chart over time, with the values under the pointer; those of now where there is none. */
export default function Chart({ data }: { data: ChartData }) {
  const frame = useRef<HTMLDivElement>(null);
  const legend = useRef<HTMLUListElement>(null);
  const time = useRef<HTMLSpanElement>(null);
  const plot = useRef<uPlot>(undefined);
  const latest = useRef(data);
  latest.current = data;
  const drawn = useMemo<uPlot.AlignedData>(() => [data.times, ...drawnValues(data.lines)], [data]);

  /** Writes the values at a place into the legend; done by hand, since it follows the pointer. */
  const show = (at: number | null | undefined) => {
    const { lines, times, digits, unit } = latest.current;
    const place = at ?? times.length - 1;
    lines.forEach(({ values }, n) => {
      const element = legend.current?.children[n]?.querySelector(".value");
      if (element) element.textContent = `${decimal(values[place], digits)} ${unit}`.trim();
    });
    const seconds = times[place];
    if (time.current) {
      time.current.textContent =
        at === null || at === undefined || seconds === undefined
          ? ""
          : timeOfDay(new Date(seconds * 1000).toISOString());
    }
  };

  const scheme = useSystemScheme();
  useEffect(() => {
    const element = frame.current;
    if (!element) return undefined;
    const options = optionsOf(element, latest.current);
    options.hooks = { setCursor: [({ cursor }) => show(cursor.idx)] };
    const made = new uPlot(options, drawn, element);
    plot.current = made;
    const observer = new ResizeObserver(() =>
      made.setSize({ width: element.clientWidth, height: HEIGHT_PX }),
    );
    observer.observe(element);
    return () => {
      observer.disconnect();
      made.destroy();
      plot.current = undefined;
    };
  }, [theme.value, scheme, data.id]);

  useEffect(() => {
    plot.current?.setData(drawn);
    show(plot.current?.cursor.idx);
  }, [drawn]);

  const now = data.lines
    .map(({ label, values }) => `${label} ${decimal(values.at(-1), data.digits)} ${data.unit}`)
    .join(", ");
  return (
    <figure class="card chart">
      <figcaption>
        <h3>{data.title}</h3>
        <span ref={time} class="muted small number" />
        <ul ref={legend} class="legend number">
          {data.lines.map(({ label, color }) => (
            <li key={label} class={color}>
              <span class="dot" aria-hidden="true" />
              {label} <span class="value" />
            </li>
          ))}
        </ul>
      </figcaption>
      <div ref={frame} role="img" aria-label={text.chartTold(data.title, now)} />
    </figure>
  );
}

/** Whether the system is dark, so that charts are drawn anew when that changes. */
function useSystemScheme(): boolean {
  const query = useMemo(() => matchMedia("(prefers-color-scheme: dark)"), []);
  const [dark, setDark] = useState(query.matches);
  useEffect(() => {
    const change = () => setDark(query.matches);
    query.addEventListener("change", change);
    return () => query.removeEventListener("change", change);
  }, [query]);
  return dark;
}
