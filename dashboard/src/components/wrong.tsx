import { useEffect, useId, useMemo, useState } from "preact/hooks";
import { sendCorrection } from "../api/inbox";
import { ELSEWHERE } from "../api/sets";
import { useAction } from "../hooks";
import { roomClass } from "../rooms";
import { blockedForData } from "../session";
import { text } from "../texts/common";
import { Button } from "./button";
import { Dialog } from "./dialog";
import { ErrorNote } from "./layout";
import { toast, toastError } from "./toasts";

interface WrongProps {
  /** The frame that was answered, as it was when the button was pressed. */
  frame: () => Promise<Blob | undefined>;
  room: string;
  /** All rooms that it could be. */
  rooms: readonly string[];
  robot?: string;
  compact?: boolean;
}

/** Beside an answer: says that it is wrong, and sends its frame to the inbox. */
export function WrongButton(props: WrongProps) {
  const [taken, setTaken] = useState<{ frame: Blob; room: string }>();
  const { room } = props;
  const open = useAction(async () => {
    const frame = await props.frame().catch((error: unknown) => toastError(error));
    if (frame) setTaken({ frame, room });
    else toast({ text: text.wrongNoFrame, kind: "bad" });
  });
  return (
    <>
      <Button
        compact={props.compact}
        blocked={blockedForData("admin")}
        busy={open.busy}
        onClick={() => void open.run()}
      >
        {text.wrong}
      </Button>
      {taken && (
        <WrongDialog
          {...taken}
          rooms={props.rooms}
          robot={props.robot}
          onClose={() => setTaken(undefined)}
        />
      )}
    </>
  );
}

function WrongDialog(props: {
  frame: Blob;
  room: string;
  rooms: readonly string[];
  robot?: string;
  onClose: () => void;
}) {
  const { frame, room, robot } = props;
  const name = useId();
  const [right, setRight] = useState("");
  const picture = useMemo(() => URL.createObjectURL(frame), [frame]);
  useEffect(() => () => URL.revokeObjectURL(picture), [picture]);
  const { run, busy, error } = useAction(async () => {
    await sendCorrection({ frame, robot, right: right || undefined });
    toast({ text: text.wrongSent });
    props.onClose();
  });
  const rooms = props.rooms.filter((other) => other !== room && other !== ELSEWHERE);
  const choices = [
    ...rooms.map((other) => ({ value: other, label: other })),
    { value: ELSEWHERE, label: text.wrongElsewhere },
    { value: "", label: text.wrongUnsure },
  ];
  return (
    <Dialog title={text.wrongTitle} onClose={props.onClose}>
      <p class="muted">{text.wrongLead}</p>
      <img class="wrong-frame" src={picture} alt={text.wrongAnswered(room)} />
      <p>{text.wrongAnswered(room)}</p>
      <fieldset class="choices">
        <legend>{text.wrongWhich}</legend>
        {choices.map(({ value, label }) => (
          <label key={value} class={roomClass(value)}>
            <input
              type="radio"
              name={name}
              checked={right === value}
              onChange={() => setRight(value)}
            />
            <span class="clip">{label}</span>
          </label>
        ))}
      </fieldset>
      {error !== undefined && <ErrorNote error={error} />}
      <div class="dialog-foot">
        <Button onClick={props.onClose}>{text.cancel}</Button>
        <Button kind="primary" busy={busy} onClick={() => void run()}>
          {text.wrongSend}
        </Button>
      </div>
    </Dialog>
  );
}
