import { Component } from "preact";
import { timeOfDay } from "../../format";
import { roomClass } from "../../rooms";
import { text } from "../../texts/live";
import { drawn, RIBBON_MS, type Stretch } from "./ribbon";

const WIDTH = 1000;

/** A ribbon moves by about a pixel in this time; more often it is not drawn. */
const STEP_MS = 3000;

interface RibbonProps {
  ribbon: readonly Stretch[];
  now: number;
  height?: number;
}

/** What can be seen of a ribbon. */
const seen = ({ ribbon, now }: RibbonProps) =>
  `${Math.floor(now / STEP_MS)} ${ribbon.length} ${ribbon.at(-1)?.from ?? 0}`;

/** The rooms of the last minutes, the present at the right; what was not known is thin and pale. */
export class RibbonBar extends Component<RibbonProps> {
  shouldComponentUpdate(next: RibbonProps): boolean {
    return seen(next) !== seen(this.props);
  }

  render(props: RibbonProps) {
    return <Ribbon {...props} />;
  }
}

function Ribbon(props: RibbonProps) {
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
