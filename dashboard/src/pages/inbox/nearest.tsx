import { useState } from "preact/hooks";
import { ApiError } from "../../api/client";
import { inboxBlob, type InboxFrame } from "../../api/inbox";
import { recognize, type NearestFrame } from "../../api/recognize";
import { changeSet, pictureAddress, getSet, undoChange } from "../../api/sets";
import { listTrainings } from "../../api/trainings";
import { Button } from "../../components/button";
import { Busy, ErrorNote } from "../../components/layout";
import { Picture } from "../../components/picture";
import { toast, toastError } from "../../components/toast";
import { percent } from "../../format";
import { useLoad } from "../../hooks";
import { blockedForData } from "../../session";
import { text } from "../../texts/inbox";
import { MoveDialog } from "../teach/move-dialog";

/** So many are drawn. */
const MOST = 6;
/** Whoever goes through frames with the keyboard asks about none of those in passing. */
const PAUSE_MS = 300;

const paused = (signal: AbortSignal) =>
  new Promise<void>((done, stopped) => {
    const timer = setTimeout(done, PAUSE_MS);
    signal.addEventListener("abort", () => {
      clearTimeout(timer);
      stopped(signal.reason as Error);
    });
  });

/** Asks the model again that answered; where it serves no more, the one that does. */
async function explained(frame: InboxFrame, signal: AbortSignal): Promise<NearestFrame[]> {
  await paused(signal);
  const picture = await inboxBlob(frame.id, signal);
  const { name: model, version } = frame.model;
  try {
    const answer = await recognize(picture, { model, version, explain: true, signal });
    return answer.nearest ?? [];
  } catch (error) {
    if (!(error instanceof ApiError) || ![404, 409].includes(error.status)) throw error;
    const answer = await recognize(picture, { explain: true, signal });
    return answer.nearest ?? [];
  }
}

/** Each training frame once, the nearest first. */
function distinct(nearest: NearestFrame[]): NearestFrame[] {
  const seen = new Set<string>();
  return nearest
    .filter(({ frame }) => frame !== "" && !seen.has(frame) && seen.add(frame))
    .sort((a, b) => b.nearness - a.nearness)
    .slice(0, MOST);
}

/** The data set that a version was trained on, where a training says so. */
async function trainedOn(frame: InboxFrame, signal: AbortSignal): Promise<string | undefined> {
  const trainings = await listTrainings(signal);
  const { name, version } = frame.model;
  return trainings.find(
    ({ published }) => published?.name === name && published.version === version,
  )?.set;
}

interface NearestProps {
  frame: InboxFrame;
}

/** Training frames that are like a frame: a wrong answer may come from one with a wrong label. */
export function Nearest({ frame }: NearestProps) {
  const nearest = useLoad((signal) => explained(frame, signal), [frame.id]);
  const origin = useLoad((signal) => trainedOn(frame, signal), [frame.id]);
  const shown = distinct(nearest.data ?? []);
  return (
    <section class="stack training-frames">
      <div>
        <h2>{text.nearest}</h2>
        <p class="muted small">{text.nearestLead}</p>
      </div>
      {nearest.loading && !nearest.data && <Busy />}
      {nearest.error !== undefined && <ErrorNote error={nearest.error} onRetry={nearest.reload} />}
      {nearest.data && shown.length === 0 && <p class="muted">{text.nearestNone}</p>}
      <ul class="training-frames-list">
        {!origin.loading &&
          shown.map((one) =>
            origin.data === undefined ? (
              // It was trained elsewhere: its frames are not here to be seen or mended.
              <li key={one.frame} class="small">
                {text.nearestOf(one.room, percent(one.nearness))} <code>{one.frame}</code>
              </li>
            ) : (
              <NearestCard key={one.frame} nearest={one} set={origin.data} />
            ),
          )}
      </ul>
    </section>
  );
}

function NearestCard({ nearest, set }: { nearest: NearestFrame; set: string }) {
  const [rooms, setRooms] = useState<string[] | undefined>(undefined);
  const [isFixed, setFixed] = useState(false);
  const blocked = blockedForData("admin");
  const { frame, room, nearness } = nearest;

  const fix = async (to?: string) => {
    setRooms(undefined);
    const frames = [frame];
    try {
      const done = await changeSet(
        set,
        to === undefined ? { action: "remove", frames } : { action: "move", frames, room: to },
      );
      setFixed(true);
      const undo = async () => {
        await undoChange(set, done.id);
        setFixed(false);
      };
      toast({ text: done.text, undo });
    } catch (error) {
      toastError(error);
    }
  };
  const askRoom = async () => {
    try {
      const details = await getSet(set);
      setRooms(details.rooms.map(({ name }) => name).filter((name) => name !== room));
    } catch (error) {
      toastError(error);
    }
  };
  return (
    <li class={isFixed ? "fixed" : undefined}>
      <Picture src={pictureAddress(set, frame, 240)} alt={frame} />
      <p class="small clip" title={frame}>
        {text.nearestOf(room, percent(nearness))}
      </p>
      <div class="row">
        <Button compact blocked={blocked} disabled={isFixed} onClick={() => void askRoom()}>
          {text.moveTraining}
        </Button>
        <Button
          compact
          icon="remove"
          label={text.removeTraining(frame)}
          blocked={blocked}
          disabled={isFixed}
          onClick={() => void fix()}
        />
      </div>
      {rooms && (
        <MoveDialog
          rooms={rooms}
          frames={1}
          onMove={(to) => void fix(to)}
          onClose={() => setRooms(undefined)}
        />
      )}
    </li>
  );
}
