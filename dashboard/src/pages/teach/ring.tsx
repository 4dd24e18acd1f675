import { ENOUGH, progress } from "./recording";
import { text } from "../../texts/teach";

const RADIUS = 44;
const LENGTH = 2 * Math.PI * RADIUS;

/** How many frames were taken, and how many are enough. */
export function Ring({ taken }: { taken: number }) {
  const share = progress(taken);
  return (
    <div
      class={share >= 1 ? "ring enough" : "ring"}
      role="progressbar"
      aria-label={text.recordTaken(taken)}
      aria-valuemin={0}
      aria-valuemax={ENOUGH}
      aria-valuenow={Math.min(taken, ENOUGH)}
    >
      <svg viewBox="0 0 100 100" aria-hidden="true">
        <circle class="ring-ground" cx="50" cy="50" r={RADIUS} />
        <circle
          class="ring-share"
          cx="50"
          cy="50"
          r={RADIUS}
          stroke-dasharray={LENGTH}
          stroke-dashoffset={LENGTH * (1 - share)}
        />
      </svg>
      <div class="ring-text">
        <strong class="number">{taken}</strong>
        <span class="small">{text.recordOf(ENOUGH)}</span>
      </div>
    </div>
  );
}
