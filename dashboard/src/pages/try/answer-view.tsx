import type { ComponentChildren } from "preact";
import type { Answer } from "../../api/recognize";
import type { Filtered } from "../../api/stream";
import { ProbabilityBars } from "../../components/bars";
import { NearestFrames } from "../../components/explained";
import { Timings } from "../../components/timings";
import { Verdict } from "../../components/verdict";
import { WrongButton } from "../../components/wrong";
import { percent } from "../../format";
import { text as common } from "../../texts/common";
import { text } from "../../texts/try";

const MOST_BARS = 6;

/** An answer beside its frame: the room, how sure, and where the time went. */
export function AnswerView(props: {
  answer: Answer;
  filtered?: Filtered | null;
  frame: Blob;
  robot?: string;
  children?: ComponentChildren;
}) {
  const { answer, filtered, frame } = props;
  const { novelty } = answer;
  return (
    <section class="card padded stack" aria-label={text.answer}>
      {filtered && (
        <div class="stack tight">
          <h2 class="small-head muted">{text.filtered}</h2>
          <Verdict {...filtered} known={filtered.known ?? false} />
          <h2 class="small-head muted">{text.single}</h2>
        </div>
      )}
      <div class="card-head">
        <div class="grow">
          <Verdict {...answer} />
        </div>
        <WrongButton frame={() => Promise.resolve(frame)} answer={answer} robot={props.robot} />
      </div>
      <ProbabilityBars probabilities={answer.probabilities} most={MOST_BARS} />
      {novelty !== undefined && novelty !== null && (
        <p class="muted small">{text.newPlace(percent(novelty))}</p>
      )}
      <Timings timings={answer.timings_ms} />
      <p class="muted small number">
        {answer.model.name}/{answer.model.version} · {common.keypoints(answer.keypoints)}
      </p>
      {props.children}
    </section>
  );
}

/** The training frames that an answer rests on. */
export function Reasons(props: {
  answer: Answer;
  chosen: string | undefined;
  onChoose: (chosen: string | undefined) => void;
}) {
  return (
    <section class="card padded stack" aria-label={common.nearest}>
      <h2>{common.nearest}</h2>
      <NearestFrames {...props} />
    </section>
  );
}
