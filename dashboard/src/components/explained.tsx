import type { ComponentChildren } from "preact";
import { useState } from "preact/hooks";
import type { Answer, NearestFrame } from "../api/recognize";
import { pictureAddress } from "../api/sets";
import { listTrainings } from "../api/trainings";
import { percent } from "../format";
import { useLoad } from "../hooks";
import { roomClass } from "../rooms";
import { service } from "../session";
import { text } from "../texts/common";
import { Picture } from "./picture";

const MOST_POINTS = 80;
const MOST_NEAREST = 8;
const THUMBNAIL_PX = 240;

interface Size {
  width: number;
  height: number;
}

/** What spoke for and against a room, to be laid over its frame; `size` is that of the frame as it was sent. */
export function EvidenceOverlay(props: { answer: Answer; size: Size; shared?: NearestFrame }) {
  const { answer, size, shared } = props;
  const evidence = (answer.evidence ?? []).slice(0, MOST_POINTS);
  const strongest = evidence.reduce((most, { weight }) => Math.max(most, Math.abs(weight)), 0);
  const unit = Math.max(size.width, size.height) / 100;
  const circle = (key: string, kind: string, x: number, y: number, radius: number) => (
    <g key={key}>
      <circle class="point under" cx={x} cy={y} r={radius} />
      <circle class={`point ${kind}`} cx={x} cy={y} r={radius} />
    </g>
  );
  return (
    <svg viewBox={`0 0 ${size.width} ${size.height}`} role="img" aria-label={text.evidence}>
      {shared
        ? (shared.points ?? [])
            .slice(0, MOST_POINTS)
            .map(([x, y], at) => circle(`s${at}`, "shared", x, y, unit * 1.2))
        : evidence.map(({ x, y, weight }, at) => {
            const share = strongest > 0 ? Math.abs(weight) / strongest : 0;
            return circle(
              `e${at}`,
              weight >= 0 ? "for" : "against",
              x,
              y,
              unit * (0.6 + 1.6 * share),
            );
          })}
    </svg>
  );
}

/** A still frame, and over it what spoke for its room. */
export function ExplainedFrame(props: {
  src: string;
  alt: string;
  answer?: Answer;
  shared?: NearestFrame;
  children?: ComponentChildren;
}) {
  const [size, setSize] = useState<Size>();
  const [failed, setFailed] = useState(false);
  if (failed) return <p class="explained cannot-show muted">{text.cannotShow}</p>;
  return (
    <div class="explained">
      <img
        src={props.src}
        alt={props.alt}
        onError={() => setFailed(true)}
        onLoad={({ currentTarget: { naturalWidth, naturalHeight } }) =>
          setSize({ width: naturalWidth, height: naturalHeight })
        }
      />
      {props.answer && size && (
        <EvidenceOverlay answer={props.answer} size={size} shared={props.shared} />
      )}
      {props.children}
    </div>
  );
}

/** What the colors over a frame mean. */
export function EvidenceLegend({ shared }: { shared?: boolean }) {
  const kinds = shared
    ? [["shared", text.evidenceShared]]
    : [
        ["for", text.evidenceFor],
        ["against", text.evidenceAgainst],
      ];
  return (
    <ul class="legend">
      {kinds.map(([kind, label]) => (
        <li key={kind}>
          <span class={`swatch ${kind}`} aria-hidden="true" />
          {label}
        </li>
      ))}
    </ul>
  );
}

/** The data set that a version was trained on by this service; undefined where it was not. */
function useTrainingSet(model: { name: string; version: number }): string | undefined {
  const hasData = service.value?.data ?? false;
  const { data } = useLoad(
    (signal) => (hasData ? listTrainings(signal) : Promise.resolve(undefined)),
    [hasData, model.name, model.version],
  );
  return data?.find(
    ({ published }) => published?.name === model.name && published.version === model.version,
  )?.set;
}

/** What names a training frame among those of an answer, and in the answers after it. */
const nameOf = ({ opinion, frame, drive }: NearestFrame) => [opinion, drive, frame].join("\n");

/** The training frame that was chosen, as an answer has it; undefined where it has not. */
export function chosenOf(answer: Answer | undefined, chosen: string | undefined) {
  return answer?.nearest?.find((frame) => nameOf(frame) === chosen);
}

/** The training frames that are most like a frame; choosing one shows what both share. */
export function NearestFrames(props: {
  answer: Answer;
  chosen: string | undefined;
  onChoose: (chosen: string | undefined) => void;
}) {
  const { answer, chosen, onChoose } = props;
  const set = useTrainingSet(answer.model);
  const nearest = (answer.nearest ?? []).slice(0, MOST_NEAREST);
  if (nearest.length === 0) return <p class="muted small">{text.nearestNone}</p>;
  return (
    <ul class="nearest">
      {nearest.map((frame, at) => (
        <li key={at}>
          <button
            type="button"
            aria-pressed={nameOf(frame) === chosen}
            aria-label={`${frame.room}, ${text.likeness(percent(frame.nearness))}. ${text.nearestShow(frame.frame)}`}
            title={frame.frame}
            onClick={() => onChoose(nameOf(frame) === chosen ? undefined : nameOf(frame))}
          >
            {set && frame.frame && (
              <Picture src={pictureAddress(set, frame.frame, THUMBNAIL_PX)} alt="" />
            )}
            <span class={`room-line ${roomClass(frame.room)}`}>
              <span class="dot" aria-hidden="true" />
              <span class="clip">{frame.room}</span>
            </span>
            <span class="muted clip">{text.likeness(percent(frame.nearness))}</span>
            <span class="muted clip">{text.nearestBy(frame.opinion)}</span>
            {!set && <span class="muted clip">{frame.frame || frame.drive}</span>}
          </button>
        </li>
      ))}
    </ul>
  );
}
