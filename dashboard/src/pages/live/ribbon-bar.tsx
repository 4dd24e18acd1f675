import { timeOfDay } from "../../format";
import { roomClass } from "../../rooms";
import { text } from "../../texts/live";
import { drawn, RIBBON_MS, type Stretch } from "./ribbon";

const WIDTH = 1000;

/** The rooms of the last minutes, the present at the right; what was not known is pale and hatched. */
export function RibbonBar(props: { ribbon: readonly Stretch[]; now: number; height?: number }) {
  const parts = drawn(props.ribbon, props.now);
  const rooms = [...new Set(parts.map(({ stretch }) => stretch.room))];
  return (
    <svg
      class="ribbon"
      viewBox={`0 0 ${WIDTH} 10`}
      preserveAspectRatio="none"
      height={props.height ?? 10}
      role="img"
      aria-label={text.ribbonOf(RIBBON_MS / 60_000, rooms.reverse().join(", "))}
    >
      {parts.map(({ stretch, left, width }) => (
        <rect
          key={stretch.from}
          class={`${roomClass(stretch.room)} ${stretch.known ? "" : "not-known"}`}
          x={left * WIDTH}
          width={Math.max(1, width * WIDTH)}
          y={stretch.known ? 0 : 3}
          height={stretch.known ? 10 : 4}
        >
          <title>
            {text.stretch(
              stretch.room,
              stretch.known,
              timeOfDay(new Date(stretch.from).toISOString()),
              timeOfDay(new Date(stretch.until).toISOString()),
            )}
          </title>
        </rect>
      ))}
    </svg>
  );
}
