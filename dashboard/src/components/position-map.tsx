import type { ComponentChildren } from "preact";
import { useMemo } from "preact/hooks";
import type { MapPosition } from "../api/models";
import { useWidth } from "../hooks";
import { roomClass } from "../rooms";
import { text } from "../texts/live";

/** From meters to the drawing, whose y axis goes down. */
export type ToDrawing = (x: number, y: number) => { x: number; y: number };

/** A drawing is as wide as there is room, within these: what is written in it keeps its size. */
const LEAST_WIDTH = 300;
const MOST_WIDTH = 1100;
const MOST_HEIGHT = 720;
const MARGIN = 50;
const BARS_M = [0.5, 1, 2, 5, 10, 20, 50, 100, 200];

/** Where training frames were taken, in the color of their room, with whatever is drawn over them. */
export function PositionMap(props: {
  positions: readonly MapPosition[];
  label: string;
  children?: (place: ToDrawing, scale: number) => ComponentChildren;
}) {
  const { positions } = props;
  const { ref, width: there } = useWidth<SVGSVGElement>();
  const width = Math.min(MOST_WIDTH, Math.max(LEAST_WIDTH, there));
  const drawing = useMemo(() => drawingOf(positions, width), [positions, width]);
  const dots = useMemo(
    () =>
      [...Map.groupBy(positions, ({ room }) => room)].map(([room, list]) => (
        <path
          key={room}
          class={`position ${roomClass(room)}`}
          d={list
            .map(({ x, y }) => {
              const at = drawing.place(x, y);
              return `M${at.x.toFixed(1)} ${at.y.toFixed(1)}h0`;
            })
            .join("")}
        />
      )),
    [positions, drawing],
  );
  const bar = BARS_M.findLast((meters) => meters * drawing.scale < width / 5) ?? 1;
  return (
    <svg
      ref={ref}
      class="positions"
      viewBox={`0 0 ${width} ${drawing.height}`}
      role="group"
      aria-label={props.label}
    >
      {dots}
      {middles(positions).map(({ room, x, top }) => {
        const at = drawing.place(x, top);
        return (
          <text key={room} class="room-name" x={at.x} y={at.y - 12}>
            {room}
          </text>
        );
      })}
      {props.children?.(drawing.place, drawing.scale)}
      <g transform={`translate(${MARGIN} ${drawing.height - 16})`}>
        <path class="scale-bar" d={`M0 -5v5h${bar * drawing.scale}v-5`} />
        <text class="scale-text" x={bar * drawing.scale + 10}>
          {text.meters(bar)}
        </text>
      </g>
    </svg>
  );
}

/** The middle of a room, and how far up it goes. */
interface Middle extends MapPosition {
  top: number;
}

/** The middle of each room. */
export function middles(positions: readonly MapPosition[]): Middle[] {
  return [...Map.groupBy(positions, ({ room }) => room)].map(([room, list]) => ({
    room,
    x: list.reduce((sum, { x }) => sum + x, 0) / list.length,
    y: list.reduce((sum, { y }) => sum + y, 0) / list.length,
    top: list.reduce((most, { y }) => Math.max(most, y), -Infinity),
  }));
}

function drawingOf(positions: readonly MapPosition[], width: number) {
  const range = (values: number[]) => {
    const least = values.reduce((one, other) => Math.min(one, other), Infinity);
    const most = values.reduce((one, other) => Math.max(one, other), -Infinity);
    return { least, size: Math.max(1, most - least) };
  };
  const x = range(positions.map((position) => position.x));
  const y = range(positions.map((position) => position.y));
  const scale = Math.min((width - 2 * MARGIN) / x.size, (MOST_HEIGHT - 2 * MARGIN) / y.size);
  const height = y.size * scale + 2 * MARGIN;
  const left = (width - x.size * scale) / 2;
  const place: ToDrawing = (px, py) => ({
    x: left + (px - x.least) * scale,
    y: height - MARGIN - (py - y.least) * scale,
  });
  return { scale, height, place };
}
