import type { TimingsMs } from "../api/recognize";
import { milliseconds } from "../format";
import { text } from "../texts/common";

/** The stages of a frame in order, with the color that each has in all charts. */
export const STAGES = [
  { id: "queue", color: 6 },
  { id: "decode", color: 5 },
  { id: "features", color: 0 },
  { id: "classify", color: 2 },
] as const;

/** Where the time of one frame went. */
export function Timings({ timings }: { timings: TimingsMs }) {
  const total = STAGES.reduce((sum, { id }) => sum + timings[id], 0);
  return (
    <div class="timings">
      <div class="timing-bar" aria-hidden="true">
        {STAGES.map(({ id, color }) => (
          <div key={id} class={`room-${color}`} style={{ flexGrow: timings[id] / (total || 1) }} />
        ))}
      </div>
      <ul class="legend number" aria-label={text.timings}>
        {STAGES.map(({ id, color }) => (
          <li key={id} class={`room-${color}`}>
            <span class="dot" aria-hidden="true" />
            {text.stages[id]} {milliseconds(timings[id])}
          </li>
        ))}
      </ul>
    </div>
  );
}
