import type { RoomProbability } from "../api/recognize";
import { percent } from "../format";
import { roomClass } from "../rooms";

const clamp = (share: number) => Math.min(1, Math.max(0, share));

/** Rooms with their probabilities. */
export function ProbabilityBars(props: { probabilities: RoomProbability[]; most?: number }) {
  return (
    <ul class="bars">
      {props.probabilities.slice(0, props.most).map(({ room, probability }) => (
        <li key={room} class={`bar ${roomClass(room)}`}>
          <span class="clip">{room}</span>
          <span class="number">{percent(probability)}</span>
          <div class="track" aria-hidden="true">
            <div class="fill" style={{ transform: `scaleX(${clamp(probability)})` }} />
          </div>
        </li>
      ))}
    </ul>
  );
}

/** How far something has come; without a value it is only under way. */
export function Progress({ value, label }: { value?: number; label: string }) {
  const share = clamp(value ?? 0);
  return (
    <div
      class="progress"
      role="progressbar"
      aria-label={label}
      aria-valuemin={0}
      aria-valuemax={100}
      aria-valuenow={value === undefined ? undefined : Math.round(share * 100)}
    >
      <div style={{ transform: `scaleX(${share})` }} />
    </div>
  );
}
