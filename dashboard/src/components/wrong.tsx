import { signal } from "@preact/signals";
import { useEffect, useId, useMemo, useState } from "preact/hooks";
import { sendCorrection } from "../api/inbox";
import type { RoomProbability } from "../api/recognize";
import { ELSEWHERE } from "../api/sets";
import { useAction } from "../hooks";
import { mapOf } from "../model-map";
import { roomClass } from "../rooms";
import { blockedForData } from "../session";
import { text } from "../texts/common";
import { Button } from "./button";
import { Dialog } from "./dialog";
import { ErrorNote } from "./layout";
import { toast, toastError } from "./toast";

interface WrongProps {
  /** The frame that was answered, as it was when the button was pressed. */
  frame: () => Promise<Blob | undefined>;
  /** What was answered, and by whom. */
  answer: { room: string; probabilities: RoomProbability[]; model?: Version | null };
  robot?: string;
  /** On a card: small, and with words of its own for those who do not see which card it is on. */
  label?: string;
}

interface Version {
  name: string;
  version: number;
}

interface Taken {
  frame: Blob;
  room: string;
  /** All rooms that it could be. */
  rooms: readonly string[];
  robot?: string;
}

const correcting = signal<Taken | undefined>(undefined);

/** Beside an answer: says that it is wrong, and sends its frame to the inbox. */
export function WrongButton({ frame, answer, robot, label }: WrongProps) {
  const open = useAction(async () => {
    try {
      const taken = await frame();
      if (taken) {
        correcting.value = {
          frame: taken,
          room: answer.room,
          rooms: await roomsOf(answer),
          robot,
        };
      } else toast({ text: text.wrongNoFrame, kind: "bad" });
    } catch (error) {
      toastError(error);
    }
  });
  return (
    <Button
      compact={label !== undefined}
      kind={label === undefined ? undefined : "plain"}
      label={label}
      blocked={blockedForData("admin")}
      busy={open.busy}
      onClick={() => void open.run()}
    >
      {text.wrong}
    </Button>
  );
}

/** Shows what a `WrongButton` opens; once in the page, since cards come and go. */
export function Corrections() {
  const taken = correcting.value;
  if (!taken) return null;
  const close = () => {
    correcting.value = undefined;
  };
  return <WrongDialog {...taken} onClose={close} />;
}

/** All rooms that the model of an answer tells apart; those that it named where the model is gone. */
async function roomsOf({ model, probabilities }: WrongProps["answer"]): Promise<string[]> {
  const named = probabilities.map(({ room }) => room);
  if (!model) return named;
  return await mapOf(model).then(
    ({ rooms }) => rooms,
    () => named,
  );
}

function WrongDialog(props: Taken & { onClose: () => void }) {
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
