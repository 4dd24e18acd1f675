import { useEffect, useState } from "preact/hooks";
import { getSet, type DataSet } from "../../api/sets";
import { BackLink } from "../../components/back-link";
import { cameraMissing, useCamera, type Camera } from "../../camera";
import { Button } from "../../components/button";
import { CompactSelect, TextField } from "../../components/fields";
import { EmptyState, ErrorNote, Note, PageHead } from "../../components/layout";
import { useLoad } from "../../hooks";
import { go, href } from "../../route";
import { blockedForData } from "../../session";
import { text as common } from "../../texts/common";
import { text } from "../../texts/teach";
import { named } from "./folders";
import { useRecorder, type Recorder } from "./recorder";
import { ENOUGH, PLENTY } from "./recording";
import { Ring } from "./ring";

/** What was recorded in one walk. */
interface Walk {
  room: string;
  drive: string;
  frames: number;
}

/** Records rooms of a data set with a camera, one after another. */
export function RecordPage({ set }: { set: string }) {
  const [room, setRoom] = useState<string | undefined>(undefined);
  const [walks, setWalks] = useState<Walk[]>([]);
  const { data, error, reload } = useLoad((signal) => getSet(set, signal), [set]);
  const blocked = blockedForData("admin");

  const finish = (walk: Walk) => {
    if (walk.frames > 0) setWalks([...walks, walk]);
    setRoom(undefined);
    reload();
  };
  return (
    <>
      <PageHead title={text.recordTitle}>
        <BackLink href={href("teach", set)} label={set} />
      </PageHead>
      {error !== undefined && <ErrorNote error={error} onRetry={reload} />}
      {blocked !== undefined && (
        <Note kind="warn">
          <p>{blocked}</p>
        </Note>
      )}
      {blocked === undefined && room === undefined && (
        <RoomForm set={set} data={data} walks={walks} onStart={(name) => setRoom(named(name))} />
      )}
      {blocked === undefined && room !== undefined && (
        <Recording key={`${room} ${walks.length}`} set={set} room={room} onFinish={finish} />
      )}
    </>
  );
}

interface RoomFormProps {
  set: string;
  data?: DataSet;
  walks: Walk[];
  onStart: (room: string) => void;
}

/** Asks which room is recorded next; says what was recorded. */
function RoomForm({ set, data, walks, onStart }: RoomFormProps) {
  const [name, setName] = useState("");
  const [isTold, setTold] = useState(false);
  const missing = cameraMissing();
  const there = data?.rooms.find((room) => room.name === name.trim());
  const last = walks.at(-1);
  const submit = (event: Event) => {
    event.preventDefault();
    setTold(true);
    if (name.trim() !== "") onStart(name);
  };
  return (
    <div class="record-form stack">
      {last && (
        <EmptyState
          icon="check"
          title={text.recordFinished(last.room, last.frames)}
          text={text.recordSummary(last.frames, last.drive)}
        >
          <Button onClick={() => go(href("teach", set))}>{text.recordSee}</Button>
        </EmptyState>
      )}
      {missing !== undefined && (
        <Note kind="warn">
          <p>{missing}</p>
        </Note>
      )}
      <form class="card padded stack" onSubmit={submit}>
        {last && <h2>{text.recordNext}</h2>}
        <TextField
          label={text.recordRoom}
          hint={there ? text.recordThere(there.frames) : text.recordRoomHint}
          wrong={isTold && name.trim() === "" ? text.uploadNoRoom : undefined}
          value={name}
          onInput={setName}
          suggestions={data?.rooms.map((room) => room.name)}
          maxLength={64}
          autoFocus
        />
        <p class="muted">{text.recordTips}</p>
        <div class="row">
          <Button kind="primary" type="submit" icon="camera" disabled={missing !== undefined}>
            {text.recordStart}
          </Button>
        </div>
      </form>
    </div>
  );
}

interface RecordingProps {
  set: string;
  room: string;
  onFinish: (walk: Walk) => void;
}

function Recording({ set, room, onFinish }: RecordingProps) {
  const camera = useCamera();
  const recorder = useRecorder(set, room, camera);
  const [isEnding, setEnding] = useState(false);
  const { taken, drive, sending, isTaking, setTaking } = recorder;

  useEffect(() => {
    void camera.start().then(() => setTaking(true));
  }, []);

  const finish = async () => {
    setEnding(true);
    const frames = recorder.finish();
    camera.stop();
    onFinish({ room, drive, frames: await frames });
  };

  return (
    <div class="record">
      <div class="card record-camera">
        <video ref={camera.video} muted playsInline aria-label={text.recordVideo} />
        {!camera.running && !isEnding && camera.problem === undefined && (
          <p class="record-over">{text.recordStarting}</p>
        )}
        {camera.running && !isTaking && <p class="record-over">{text.recordPaused}</p>}
        {camera.running && isTaking && (
          <p class="record-live">
            <span class="record-dot" aria-hidden="true" /> {text.recordTaking}
          </p>
        )}
      </div>
      <div class="record-side stack">
        <h2 class="clip">{room}</h2>
        <div class="record-state">
          <Ring taken={taken} />
          <div class="stack">
            <p class="record-said" aria-live="polite">
              {saidOf(recorder)}
            </p>
            <p class="muted">{moreOf(taken)}</p>
            <p class="muted small number">{text.recordAway(sending.waiting)}</p>
          </div>
        </div>
        {camera.problem !== undefined && (
          <Note kind="bad">
            <p>{camera.problem}</p>
            <Button compact onClick={() => void camera.start()}>
              {common.retry}
            </Button>
          </Note>
        )}
        <Sending recorder={recorder} />
        <div class="row">
          <Button disabled={!camera.running || isEnding} onClick={() => setTaking(!isTaking)}>
            {isTaking ? text.recordPause : text.recordResume}
          </Button>
          <Button
            kind={taken >= ENOUGH ? "primary" : undefined}
            icon="check"
            busy={isEnding}
            onClick={() => void finish()}
          >
            {text.recordFinish}
          </Button>
          <CameraChoice camera={camera} />
        </div>
        <p class="muted small">{text.recordTips}</p>
      </div>
    </div>
  );
}

function CameraChoice({ camera }: { camera: Camera }) {
  if (camera.devices.length < 2) return null;
  return (
    <CompactSelect
      label={common.cameraChoose}
      value={camera.device ?? ""}
      options={camera.devices.map(({ id, label }) => ({ value: id, label }))}
      onChange={(device) => void camera.start(device)}
    />
  );
}

/** What keeps pictures from being kept. */
function Sending({ recorder }: { recorder: Recorder }) {
  const { sending, refused } = recorder;
  return (
    <>
      {sending.held?.then === "again" && (
        <Note kind="warn">
          <p>
            {text.recordOffline} {sending.held.reason}
          </p>
        </Note>
      )}
      {sending.held?.then === "stop" && (
        <Note kind="bad">
          <p>
            {sending.held.reason} {text.recordStopped}
          </p>
          <Button compact onClick={recorder.resume}>
            {text.recordTryAgain}
          </Button>
        </Note>
      )}
      {refused.count > 0 && (
        <Note kind="warn">
          <p>{text.recordRefused(refused.count, refused.reason)}</p>
        </Note>
      )}
    </>
  );
}

function saidOf({ said, sending, isTaking }: Recorder): string {
  if (sending.held?.then === "stop") return text.recordHeld;
  if (!isTaking) return text.recordPaused;
  if (said === undefined) return text.recordStarting;
  return said === "waiting" ? text.recordWaiting : text.recordSay[said];
}

function moreOf(taken: number): string {
  if (taken < ENOUGH) return text.recordMore(ENOUGH - taken);
  return taken < PLENTY ? text.recordEnough : text.recordPlenty;
}
