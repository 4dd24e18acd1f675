import { useEffect, useMemo, useRef, useState } from "preact/hooks";
import { addFrames, type Refused } from "../../api/sets";
import { Progress } from "../../components/bars";
import { Button } from "../../components/button";
import { confirm, Dialog } from "../../components/dialog";
import { SelectField, TextField } from "../../components/fields";
import { Note } from "../../components/layout";
import { bytes } from "../../format";
import { text as common } from "../../texts/common";
import { text } from "../../texts/teach";
import { chosen, hasFiles, readDropped, type DroppedFile } from "./dropped";
import { chunks, levelOfRooms, named, placed, type Placed } from "./folders";
import { judge } from "./judge";
import { driveName } from "./recording";
import { Sender, type SenderState } from "./sender";

const LIMITS = { files: 8, bytes: 24 * 2 ** 20 };
/** Refused files that are named; the rest is counted. */
const NAMED = 100;

interface UploadDialogProps {
  set: string;
  rooms: string[];
  /** What was dropped on the page. */
  files: DroppedFile[];
  onAdded: () => void;
  onClose: () => void;
}

/** Adds pictures and folders to a set. */
export function UploadDialog(props: UploadDialogProps) {
  const [files, setFiles] = useState(props.files);
  const [plan, setPlan] = useState<Placed<File>[] | undefined>(undefined);
  const [isBusy, setBusy] = useState(false);
  const close = async () => {
    const question = { title: text.uploadTitle, text: text.uploadLeave, action: text.uploadStop };
    if (!isBusy || (await confirm(question))) props.onClose();
  };
  return (
    <Dialog title={text.uploadTitle} onClose={() => void close()}>
      {plan === undefined ? (
        <Choice {...props} files={files} onFiles={setFiles} onPlan={setPlan} />
      ) : (
        <Transfer
          set={props.set}
          files={plan}
          onAdded={props.onAdded}
          onBusy={setBusy}
          onClose={props.onClose}
        />
      )}
    </Dialog>
  );
}

interface ChoiceProps {
  rooms: string[];
  files: DroppedFile[];
  onFiles: (files: DroppedFile[]) => void;
  onPlan: (files: Placed<File>[]) => void;
}

/** What is added, and where it goes. */
function Choice({ rooms, files, onFiles, onPlan }: ChoiceProps) {
  const [level, setLevel] = useState<number | undefined>(undefined);
  const [room, setRoom] = useState("");
  const [drive, setDrive] = useState(() => driveName(new Date()));
  const [isTold, setTold] = useState(false);
  const [isReading, setReading] = useState(false);
  const pictureField = useRef<HTMLInputElement>(null);
  const folderField = useRef<HTMLInputElement>(null);
  useEffect(() => folderField.current?.setAttribute("webkitdirectory", ""), []);

  const paths = files.map(({ path }) => path);
  const guessed = useMemo(() => levelOfRooms(paths), [files]);
  const used = level ?? guessed;
  const plan = placed(files, used, room, drive);
  const needsRoom = paths.some((path) => path.split("/").length - 1 <= used);
  const take = async (event: DragEvent) => {
    if (!hasFiles(event) || !event.dataTransfer) return;
    event.preventDefault();
    event.stopPropagation();
    setReading(true);
    onFiles(await readDropped(event.dataTransfer));
    setReading(false);
  };
  const submit = (event: Event) => {
    event.preventDefault();
    setTold(true);
    if (!needsRoom || room.trim() !== "") onPlan(plan);
  };
  const choose = (field: HTMLInputElement) => {
    onFiles(chosen(field.files));
    setLevel(undefined);
  };

  return (
    <form class="stack" onSubmit={submit}>
      <div
        class="dropzone"
        onDragOver={(event) => event.preventDefault()}
        onDrop={(event) => void take(event)}
      >
        <p>{isReading ? text.uploadReading : text.uploadLead}</p>
        <div class="row">
          <Button icon="picture" onClick={() => pictureField.current?.click()}>
            {text.choosePictures}
          </Button>
          <Button icon="upload" onClick={() => folderField.current?.click()}>
            {text.chooseFolder}
          </Button>
        </div>
        <input
          ref={pictureField}
          hidden
          type="file"
          accept="image/*"
          multiple
          aria-label={text.choosePictures}
          onChange={(event) => choose(event.currentTarget)}
        />
        <input
          ref={folderField}
          hidden
          type="file"
          multiple
          aria-label={text.chooseFolder}
          onChange={(event) => choose(event.currentTarget)}
        />
      </div>
      {files.length > 0 && (
        <>
          <Levels paths={paths} level={used} onLevel={setLevel} />
          {needsRoom && (
            <TextField
              label={text.uploadInto}
              hint={text.uploadIntoHint}
              wrong={isTold && room.trim() === "" ? text.uploadNoRoom : undefined}
              value={room}
              onInput={setRoom}
              suggestions={rooms}
              maxLength={64}
            />
          )}
          <TextField
            label={text.uploadDrive}
            hint={text.uploadDriveHint}
            value={drive}
            onInput={(typed) => setDrive(named(typed))}
            maxLength={64}
          />
          <Plan files={plan} />
        </>
      )}
      <div class="dialog-foot">
        <Button kind="primary" type="submit" icon="add" disabled={files.length === 0}>
          {text.uploadStart(files.length)}
        </Button>
      </div>
    </form>
  );
}

interface LevelsProps {
  paths: string[];
  level: number;
  onLevel: (level: number) => void;
}

/** Which of the folders are rooms, where it could be several. */
function Levels({ paths, level, onLevel }: LevelsProps) {
  const deepest = Math.max(...paths.map((path) => path.split("/").length - 1));
  if (deepest < 2) return null;
  const example = (at: number) => {
    const names = new Set(paths.map((path) => path.split("/").slice(0, -1)[at]).filter(Boolean));
    return [...names].slice(0, 3).join(", ");
  };
  const options = Array.from({ length: deepest }, (_, at) => ({
    value: String(at),
    label: text.uploadLevelOf(example(at)),
  }));
  return (
    <SelectField
      label={text.uploadLevel}
      value={String(level)}
      options={options}
      onChange={(value) => onLevel(Number(value))}
    />
  );
}

function Plan({ files }: { files: Placed<File>[] }) {
  const rooms = new Map<string, number>();
  for (const { room } of files) rooms.set(room, (rooms.get(room) ?? 0) + 1);
  const size = files.reduce((sum, { item }) => sum + item.size, 0);
  return (
    <Note>
      <p>
        <strong>{text.uploadPlan(files.length, bytes(size))}</strong>
        <br />
        {[...rooms].map(([room, n]) => `${room} (${n})`).join(", ")}
      </p>
    </Note>
  );
}

interface TransferProps {
  set: string;
  files: Placed<File>[];
  onAdded: () => void;
  onBusy: (isBusy: boolean) => void;
  onClose: () => void;
}

interface Outcome {
  done: number;
  added: number;
  copies: number;
  refused: Refused[];
}

/** Sends the pictures, a few at a time, and tells what became of them. */
function Transfer({ set, files, onAdded, onBusy, onClose }: TransferProps) {
  const [outcome, setOutcome] = useState<Outcome>({ done: 0, added: 0, copies: 0, refused: [] });
  const [state, setState] = useState<SenderState>({ waiting: 1, sent: 0 });
  const sender = useRef<Sender<Placed<File>[]> | undefined>(undefined);

  useEffect(() => {
    const parcels = chunks(files, ({ size }) => size, LIMITS);
    const made = new Sender<Placed<File>[]>({
      capacity: parcels.length,
      judge,
      changed: setState,
      dropped: (parcel, reason) =>
        setOutcome((before) => ({
          ...before,
          done: before.done + parcel.length,
          refused: [...before.refused, ...parcel.map(({ name }) => ({ name, reason }))],
        })),
      send: async (parcel) => {
        const { room, drive } = parcel[0] as Placed<File>;
        const pictures = parcel.map(({ name, item }) => ({ name, picture: item }));
        const { added, copies, refused } = await addFrames(set, room, drive, pictures);
        setOutcome((before) => ({
          done: before.done + parcel.length,
          added: before.added + added.length,
          copies: before.copies + copies.length,
          refused: [...before.refused, ...refused],
        }));
      },
    });
    sender.current = made;
    onBusy(true);
    parcels.forEach((parcel) => made.offer(parcel));
    void made.empty().then(() => {
      onBusy(false);
      onAdded();
    });
    return () => made.close();
  }, []);

  const { done, added, copies, refused } = outcome;
  const isDone = state.waiting === 0;
  return (
    <div class="stack">
      <div role="status" class="stack">
        <p class="number">{text.uploadProgress(done, files.length)}</p>
        <Progress label={text.uploadTitle} value={done / files.length} />
        {added > 0 && <p>{text.uploadAdded(added)}</p>}
        {copies > 0 && <p class="muted">{text.uploadCopies(copies)}</p>}
      </div>
      {state.held && (
        <Note kind={state.held.then === "stop" ? "bad" : "warn"}>
          <p>
            {state.held.reason} {state.held.then === "again" && text.again}
          </p>
          {state.held.then === "stop" && (
            <Button compact onClick={() => sender.current?.resume()}>
              {text.goOn}
            </Button>
          )}
        </Note>
      )}
      {refused.length > 0 && <RefusedFiles refused={refused} />}
      <div class="dialog-foot">
        {isDone ? (
          <Button kind="primary" onClick={onClose}>
            {text.done}
          </Button>
        ) : (
          <Button onClick={onClose}>{common.cancel}</Button>
        )}
      </div>
    </div>
  );
}

function RefusedFiles({ refused }: { refused: Refused[] }) {
  return (
    <Note kind="warn">
      <div class="grow">
        <p>{text.uploadRefused(refused.length)}</p>
        <ul class="refused small">
          {refused.slice(0, NAMED).map(({ name, reason }, index) => (
            <li key={index}>
              <strong>{name}</strong>: {reason}
            </li>
          ))}
        </ul>
      </div>
    </Note>
  );
}
