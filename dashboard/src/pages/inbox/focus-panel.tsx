import { inboxPicture, type InboxFrame } from "../../api/inbox";
import { ProbabilityBars } from "../../components/bars";
import { Button } from "../../components/button";
import { Badge } from "../../components/layout";
import { Picture } from "../../components/picture";
import { Verdict } from "../../components/verdict";
import { dateTime, percent } from "../../format";
import { href } from "../../route";
import { blockedForData } from "../../session";
import { text } from "../../texts/inbox";
import { Nearest } from "./nearest";

interface FocusPanelProps {
  frame: InboxFrame;
  /** Where labeled frames go. */
  set?: string;
  onLabel: (room: string) => void;
  onEnlarge: () => void;
}

/** All there is to know about the focused frame. */
export function FocusPanel({ frame, set, onLabel, onEnlarge }: FocusPanelProps) {
  const { label, said, filtered_room: filtered, shadow_room: shadow, model } = frame;
  return (
    <aside class="card focus-panel" aria-label={text.panel}>
      <Picture whole eager src={inboxPicture(frame.id, 640)} alt={text.panel} />
      <div class="focus-body stack">
        <div class="row">
          <span class="muted small grow">
            {text.from(frame.robot ?? frame.key ?? text.someRobot, dateTime(frame.at))}
          </span>
          <Button compact icon="search" onClick={onEnlarge}>
            {text.enlarge}
          </Button>
        </div>
        <Verdict {...frame} />
        <ProbabilityBars probabilities={frame.probabilities} />
        <div class="row">
          {frame.reasons.map((reason) => (
            <Badge key={reason} kind="warn">
              {text.reasons[reason]}
            </Badge>
          ))}
          <Badge>{text.teaches(percent(frame.value))}</Badge>
          <a class="small" href={href("models", model.name, model.version)}>
            {text.byModel(model.name, model.version)}
          </a>
        </div>
        {said !== undefined && (
          <div class="row">
            <p>{text.said(said)}</p>
            {!label && set !== undefined && (
              <Button compact blocked={blockedForData("admin")} onClick={() => onLabel(said)}>
                {text.labelSaid(said)}
              </Button>
            )}
          </div>
        )}
        {filtered !== undefined && <p>{text.filteredRoom(filtered)}</p>}
        {shadow !== undefined && <p>{text.shadowRoom(shadow)}</p>}
        {label && (
          <p>
            <strong>{text.labelOf(label.room, label.set, label.by, dateTime(label.at))}</strong>
          </p>
        )}
        <Nearest frame={frame} />
      </div>
    </aside>
  );
}
