import type { Comparison, Share } from "../../api/trainings";
import { Note } from "../../components/layout";
import { percent } from "../../format";
import { text } from "../../texts/models";

/** A training beside the version that serves. */
export function ComparisonView({ comparison }: { comparison: Comparison }) {
  const { serving, before, now, is_worse: isWorse, compared_on: on } = comparison;
  return (
    <div class="stack">
      <p class="muted small">{text.comparisonLead[on]}</p>
      <div class="bars">
        <ShareBar label={serving} share={before} index={0} />
        <ShareBar label={text.now} share={now} index={1} />
      </div>
      <Note kind={isWorse ? "bad" : "good"}>
        <p>{isWorse ? text.comparisonWorse : text.comparisonBetter}</p>
      </Note>
    </div>
  );
}

function ShareBar({ label, share, index }: { label: string; share: Share; index: number }) {
  const rate = share.n_right / Math.max(share.n_frames, 1);
  return (
    <div class={`bar subject-${index}`}>
      <span class="clip">{label}</span>
      <span class="number">
        <strong>{percent(rate)}</strong>{" "}
        <span class="muted">{text.rightOf(share.n_right, share.n_frames)}</span>
      </span>
      <div class="track" aria-hidden="true">
        <div class="fill" style={{ transform: `scaleX(${rate})` }} />
      </div>
    </div>
  );
}
