import { decimal } from "../../format";
import type { Rate } from "../../api/trainings";
import { isClear } from "./charts";

/** The difference in percentage points; colored where chance does not explain it. */
export function Difference({ before, now }: { before: Rate | undefined; now: Rate | undefined }) {
  if (before?.rate == null || now?.rate == null) return null;
  const points = (now.rate - before.rate) * 100;
  const hasCounts = before.n_frames > 0 && now.n_frames > 0;
  const kind = !hasCounts || !isClear(before, now) ? "muted" : points > 0 ? "better" : "worse";
  const sign = points > 0 ? "+" : points < 0 ? "−" : "±";
  return (
    <span class={kind}>
      {sign}
      {decimal(Math.abs(points))}
    </span>
  );
}
