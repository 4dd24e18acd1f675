import type { Unknown } from "../api/recognize";
import { percent } from "../format";
import { roomClass } from "../rooms";
import { text as common } from "../texts/common";
import { Badge } from "./layout";

export interface VerdictProps {
  room?: string | null;
  known: boolean;
  unknown?: Unknown | null;
  probability?: number | null;
}

/** The room that was answered, and whether it is one to act on, in words. */
export function Verdict({ room, known, unknown, probability }: VerdictProps) {
  return (
    <div class={`verdict ${known ? "" : "not-known"} ${roomClass(room)}`}>
      <p class="verdict-room">
        <span class="dot" aria-hidden="true" />
        <span class="clip" title={room ?? undefined}>
          {room ?? common.noRoom}
        </span>
      </p>
      <p class="verdict-more">
        <Badge kind={known ? "good" : "warn"}>{known ? common.known : common.notKnown}</Badge>
        <span class="number">{percent(probability)}</span>
        {!known && unknown && <span class="muted">{common.reasons[unknown]}</span>}
      </p>
    </div>
  );
}
