import { useMemo } from "preact/hooks";
import type { ModelMap } from "../../api/models";
import { EmptyState } from "../../components/layout";
import { useWidth } from "../../hooks";
import { roomClass } from "../../rooms";
import { text } from "../../texts/live";
import { around, placed, waysOf } from "./graph-layout";
import { RobotMark } from "./robot-mark";
import { robotsByRoom } from "./where";

/** A drawing is as wide as there is room, within these: what is written in it keeps its size. */
const LEAST_WIDTH = 340;
const MOST_WIDTH = 1100;
/** Below this width it stands upright, for phones. */
const UPRIGHT_BELOW = 620;
const MARGIN_Y = 80;
/** The size of rooms there. */
const SMALL = 0.7;
const NODE = 34;
const ROBOT = 15;
const MOST_ROBOTS = 18;
/** With more robots than this they stand above their room too, where its name is. */
const HALF_A_RING = 9;

/** The rooms of a model, the ways between them, and the robots where they are. */
export function RoomsGraph({ map }: { map: ModelMap }) {
  const ways = useMemo(() => waysOf(map.transitions), [map]);
  const points = useMemo(() => placed(map.rooms, ways), [map, ways]);
  const place = useWidth<HTMLElement>();
  if (map.rooms.length === 0) {
    return <EmptyState icon="models" title={text.noGraph} text={text.noGraphMore} />;
  }
  const robots = robotsByRoom();
  const upright = place.width < UPRIGHT_BELOW;
  const width = Math.min(MOST_WIDTH, Math.max(LEAST_WIDTH, place.width));
  const height = upright ? width * 1.5 : width * 0.55;
  const marginX = width * 0.14;
  const at = (room: string) => {
    const point = points.get(room) ?? { x: 0.5, y: 0.5 };
    const [x, y] = upright ? [point.y, point.x] : [point.x, point.y];
    return {
      x: marginX + x * (width - 2 * marginX),
      y: MARGIN_Y + y * (height - 2 * MARGIN_Y),
    };
  };
  return (
    <figure class="graph-figure" ref={place.ref}>
      <svg
        class={upright ? "graph upright" : "graph"}
        viewBox={`0 0 ${width} ${height}`}
        role="group"
        aria-label={text.graph}
      >
        {ways.map(({ one, other, rate }) => {
          const [from, to] = [at(one), at(other)];
          return (
            <line
              key={`${one}\n${other}`}
              class="way"
              x1={from.x}
              y1={from.y}
              x2={to.x}
              y2={to.y}
              stroke-width={1.5 + 5 * rate}
            />
          );
        })}
        {map.rooms.map((room) => {
          const { x, y } = at(room);
          const here = robots.get(room) ?? [];
          const seats = around(Math.min(here.length, MOST_ROBOTS), NODE + ROBOT * 0.75, ROBOT);
          return (
            <g
              key={room}
              transform={`translate(${x} ${y}) scale(${upright ? SMALL : 1})`}
              class={roomClass(room)}
            >
              <circle class="room-node" r={NODE} />
              <text class="room-count" y={5}>
                {here.length}
              </text>
              {seats.map((seat, n) => {
                const robot = here[n];
                return robot && <RobotMark key={robot.id} robot={robot} at={seat} />;
              })}
              <text class="room-name" y={-NODE - (here.length > HALF_A_RING ? ROBOT : 0) - 12}>
                {room}
              </text>
              {here.length > seats.length && (
                <text class="room-rest" y={NODE + 2 * ROBOT + 14}>
                  {text.moreRobots(here.length - seats.length)}
                </text>
              )}
            </g>
          );
        })}
      </svg>
      <figcaption class="muted small">{text.graphMore}</figcaption>
    </figure>
  );
}
