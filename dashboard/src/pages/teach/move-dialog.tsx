import { useId, useState } from "preact/hooks";
import { Button } from "../../components/button";
import { Dialog } from "../../components/dialog";
import { TextField } from "../../components/fields";
import { roomClass } from "../../rooms";
import { text as common } from "../../texts/common";
import { text } from "../../texts/teach";
import { named } from "./folders";

interface MoveDialogProps {
  rooms: string[];
  frames: number;
  onMove: (room: string, drive?: string) => void;
  onClose: () => void;
}

/** Asks where frames go: to a room that is there, or to a new one. */
export function MoveDialog({ rooms, frames, onMove, onClose }: MoveDialogProps) {
  const [chosen, setChosen] = useState<string | undefined>(rooms[0]);
  const [newRoom, setNewRoom] = useState("");
  const [drive, setDrive] = useState("");
  const group = useId();
  const room = chosen ?? newRoom.trim();
  const submit = (event: Event) => {
    event.preventDefault();
    if (room !== "") onMove(named(room), drive.trim() === "" ? undefined : named(drive));
  };
  return (
    <Dialog title={text.moveTitle(frames)} onClose={onClose}>
      <form class="stack" onSubmit={submit}>
        <fieldset class="choices">
          <legend class="hidden">{text.moveTitle(frames)}</legend>
          {rooms.map((name) => (
            <label key={name}>
              <input
                type="radio"
                name={group}
                checked={chosen === name}
                onChange={() => setChosen(name)}
              />
              <span class={`dot ${roomClass(name)}`} aria-hidden="true" />
              <span class="clip">{name}</span>
            </label>
          ))}
          <label>
            <input
              type="radio"
              name={group}
              checked={chosen === undefined}
              onChange={() => setChosen(undefined)}
            />
            <span class="dot" aria-hidden="true" />
            <span>{text.moveNew}</span>
          </label>
        </fieldset>
        {chosen === undefined && (
          <TextField
            label={text.roomName}
            value={newRoom}
            onInput={setNewRoom}
            maxLength={64}
            required
            autoFocus
          />
        )}
        <TextField
          label={text.moveDrive}
          hint={text.moveDriveHint}
          value={drive}
          onInput={setDrive}
          maxLength={64}
        />
        <div class="dialog-foot">
          <Button onClick={onClose}>{common.cancel}</Button>
          <Button kind="primary" type="submit" disabled={room === ""}>
            {text.moveHere}
          </Button>
        </div>
      </form>
    </Dialog>
  );
}
