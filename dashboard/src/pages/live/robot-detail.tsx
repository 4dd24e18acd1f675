import { useEffect, useState } from "preact/hooks";
import { fetchFrame, getRobot, type Robot, type RobotInfo } from "../../api/live";
import { type Answer, recognize } from "../../api/recognize";
import { ProbabilityBars } from "../../components/bars";
import { Button } from "../../components/button";
import {
  chosenOf,
  EvidenceLegend,
  ExplainedFrame,
  NearestFrames,
} from "../../components/explained";
import { Icon } from "../../components/icons";
import { Busy, EmptyState, ErrorNote, Note, PageHead } from "../../components/layout";
import { PositionMap } from "../../components/position-map";
import { Timings } from "../../components/timings";
import { Verdict } from "../../components/verdict";
import { WrongButton } from "../../components/wrong";
import { percent } from "../../format";
import { useAction, useLoad } from "../../hooks";
import { mapOf } from "../../model-map";
import { href } from "../../route";
import { blockedFor } from "../../session";
import { text as common } from "../../texts/common";
import { text } from "../../texts/live";
import { StateBadge } from "./card";
import { LastFrame } from "./last-frame";
import { Numbers, Past, PastAnswers } from "./robot-tables";
import { changes, entries, type Entry, feedState } from "./store";

const FRAME_EVERY_MS = 1000;
const INFO_EVERY_MS = 2000;
const FRAME_PX = 960;

/** One robot, in all that is known of it. */
export function RobotDetail({ id }: { id: string }) {
  const isThere = changes.value >= 0 ? entries.get(id) : undefined;
  const info = useLoad((signal) => getRobot(id, signal), [id], INFO_EVERY_MS);
  return (
    <>
      <PageHead title={id}>
        {isThere && <StateBadge robot={isThere.robot.value} />}
        <span class="grow" />
        <a class="button compact" href={href("live")}>
          <Icon name="back" />
          {text.back}
        </a>
      </PageHead>
      {isThere ? (
        <Detail id={id} entry={isThere} info={info.data} />
      ) : feedState.value === "connecting" ? (
        <Busy />
      ) : (
        <EmptyState icon="robot" title={text.notThere(id)} text={text.notThereMore} />
      )}
    </>
  );
}

/** A frame with its explanation. */
interface Explained {
  frame: Blob;
  picture: string;
  answer: Answer;
}

function Detail(props: { id: string; entry: Entry; info: RobotInfo | undefined }) {
  const { id, entry, info } = props;
  useEffect(() => {
    entry.watchers += 1;
    return () => {
      entry.watchers -= 1;
    };
  }, [entry]);
  const robot = entry.robot.value;
  const [explained, setExplained] = useState<Explained>();
  const [chosen, setChosen] = useState<string>();
  const map = useModelMap(robot);
  useEffect(
    () => () => {
      if (explained) URL.revokeObjectURL(explained.picture);
    },
    [explained],
  );
  const explain = useAction(async () => {
    const frame = await fetchFrame(id);
    const model = { model: robot.model?.name, version: robot.model?.version };
    const answer = await recognize(frame, { ...model, explain: true });
    setExplained({ frame, picture: URL.createObjectURL(frame), answer });
  });

  // Beside an explained frame stands its own answer, and "wrong" is about that.
  const shown = explained?.answer ?? robot;
  const shared = chosenOf(explained?.answer, chosen);
  return (
    <div class="robot-page">
      <section class="card padded stack" aria-label={text.frameTitle}>
        {explained ? (
          <>
            <ExplainedFrame
              src={explained.picture}
              alt={text.frameOf(id)}
              answer={explained.answer}
              shared={shared}
            />
            <EvidenceLegend shared={shared !== undefined} />
            <Note>
              <p>{text.explainOld}</p>
              <Button compact busy={explain.busy} onClick={() => void explain.run()}>
                {text.explainNext}
              </Button>
              <Button compact onClick={() => setExplained(undefined)}>
                {text.explainStop}
              </Button>
            </Note>
          </>
        ) : (
          <>
            <LastFrame id={id} every={FRAME_EVERY_MS} width={FRAME_PX} class="robot-large" />
            <div class="row">
              <Button
                icon="search"
                busy={explain.busy}
                blocked={blockedFor("robot")}
                onClick={() => void explain.run()}
              >
                {text.explain}
              </Button>
              <span class="muted small">{text.explainMore}</span>
            </div>
          </>
        )}
        {explain.error !== undefined && <ErrorNote error={explain.error} onRetry={explain.clear} />}
        {explained && (
          <section class="stack" aria-label={common.nearest}>
            <h2>{common.nearest}</h2>
            <NearestFrames answer={explained.answer} chosen={chosen} onChoose={setChosen} />
          </section>
        )}
        {info && <PastAnswers answers={info.answers} />}
      </section>
      <div class="stack">
        <section class="card padded stack" aria-label={text.answerTitle}>
          <div class="card-head">
            <div class="grow">
              <Verdict {...shown} />
            </div>
            {shown.room && (
              <WrongButton
                frame={() => (explained ? Promise.resolve(explained.frame) : fetchFrame(id))}
                answer={{ ...shown, room: shown.room }}
                robot={robot.robot ?? undefined}
              />
            )}
          </div>
          <ProbabilityBars probabilities={shown.probabilities} most={5} />
          {shown.novelty !== undefined && shown.novelty !== null && (
            <p class="muted small">{text.newPlace(percent(shown.novelty))}</p>
          )}
          {explained && <Timings timings={explained.answer.timings_ms} />}
          {!explained && info?.answers[0] && <Timings timings={info.answers[0].timings_ms} />}
        </section>
        <Past entry={entry} />
        {map && map.positions.length > 0 && (explained?.answer.pose ?? robot.pose) && (
          <WhereItIs positions={map.positions} pose={explained?.answer.pose ?? robot.pose} />
        )}
        <Numbers robot={robot} info={info} />
      </div>
    </div>
  );
}

function useModelMap({ model }: Robot) {
  const key = model ? `${model.name}/${model.version}` : "";
  return useLoad(() => (model ? mapOf(model) : Promise.resolve(undefined)), [key]).data;
}

function WhereItIs(props: {
  positions: Parameters<typeof PositionMap>[0]["positions"];
  pose: Answer["pose"];
}) {
  const { pose } = props;
  return (
    <section class="card padded stack">
      <h2>{text.mapTitle}</h2>
      <PositionMap positions={props.positions} label={text.positions}>
        {(place, scale) => {
          if (!pose) return null;
          const { x, y } = place(pose.x, pose.y);
          const ahead = { x: x + 34 * Math.cos(pose.angle), y: y - 34 * Math.sin(pose.angle) };
          return (
            <g class="pose">
              <circle class="pose-radius" cx={x} cy={y} r={Math.max(10, pose.radius * scale)} />
              <line x1={x} y1={y} x2={ahead.x} y2={ahead.y} />
              <circle class="robot-mark known" cx={x} cy={y} r={9} />
            </g>
          );
        }}
      </PositionMap>
    </section>
  );
}
