import { useState } from "preact/hooks";
import { getPolicy } from "../../api/inbox";
import { ELSEWHERE, getSet, listSets } from "../../api/sets";
import { Button } from "../../components/button";
import { Dialog } from "../../components/dialog";
import { CompactSelect, TextField } from "../../components/fields";
import { Note } from "../../components/layout";
import { useLoad } from "../../hooks";
import { roomClass } from "../../rooms";
import { href } from "../../route";
import { blockedForData } from "../../session";
import { text as common } from "../../texts/common";
import { text } from "../../texts/inbox";
import { named } from "../teach/folders";

/** Keys 1 to 9 name rooms. */
const KEYS = 9;
const ELSEWHERE_KEY = "e";

/** Where labeled frames go. */
export interface Target {
  sets: string[];
  /** Undefined until it is known, or where there is none. */
  set?: string;
  rooms: string[];
  choose: (set: string) => void;
  /** The room that a key stands for. */
  roomOfKey: (key: string) => string | undefined;
  isAsking: boolean;
  askNewRoom: () => void;
  stopAsking: () => void;
  reload: () => void;
}

/** The data set that labeled frames go to, and its rooms: that of the policy first, else the first there is. */
export function useTarget(): Target {
  const [chosen, setChosen] = useState<string | undefined>(undefined);
  const [isAsking, setAsking] = useState(false);
  const sets = useLoad(listSets, []);
  const policy = useLoad(getPolicy, []);
  const names = sets.data?.sets.map(({ name }) => name) ?? [];
  const preferred = names.find((name) => name === policy.data?.set) ?? names[0];
  const set = chosen ?? (policy.loading ? undefined : preferred);
  const details = useLoad(
    async (signal) => (set === undefined ? undefined : await getSet(set, signal)),
    [set],
  );
  const rooms = details.data?.rooms.map(({ name }) => name).filter((name) => name !== ELSEWHERE);
  return {
    sets: names,
    set,
    rooms: rooms ?? [],
    choose: setChosen,
    roomOfKey: (key) => {
      if (key === ELSEWHERE_KEY) return ELSEWHERE;
      return /^[1-9]$/.test(key) ? rooms?.[Number(key) - 1] : undefined;
    },
    isAsking,
    askNewRoom: () => setAsking(true),
    stopAsking: () => setAsking(false),
    reload: details.reload,
  };
}

interface LabelBarProps {
  target: Target;
  selected: number;
  onLabel: (room: string) => void;
  onDiscard: () => void;
  onSelectAll: () => void;
  onSelectNone: () => void;
}

/** Says what the selected frames show. */
export function LabelBar(props: LabelBarProps) {
  const { target, selected, onLabel } = props;
  const blocked = blockedForData("admin");
  return (
    <div class="label-bar card" role="group" aria-label={text.labelBar}>
      <div class="row">
        <span class="number label-count" aria-live="polite">
          {selected > 0 ? text.selected(selected) : text.focusedOnly}
        </span>
        <Button compact kind="plain" onClick={props.onSelectAll}>
          {text.selectAll}
        </Button>
        <Button compact kind="plain" disabled={selected === 0} onClick={props.onSelectNone}>
          {text.selectNone}
        </Button>
        <span class="grow" />
        {target.sets.length > 0 && (
          <label class="row small">
            {text.set}
            <CompactSelect
              label={text.set}
              value={target.set ?? ""}
              options={target.sets.map((name) => ({ value: name, label: name }))}
              onChange={target.choose}
            />
          </label>
        )}
        <Button compact icon="remove" blocked={blocked} onClick={props.onDiscard}>
          {text.discard}
        </Button>
      </div>
      {target.set === undefined ? (
        <Note>
          <p>
            {text.noSets} <a href={href("teach")}>{text.makeSet}</a>
          </p>
        </Note>
      ) : (
        <div class="row">
          <span class="muted small">{text.labelAs}</span>
          {target.rooms.map((room, index) => (
            <RoomButton
              key={room}
              room={room}
              shortcut={index < KEYS ? String(index + 1) : undefined}
              blocked={blocked}
              onClick={() => onLabel(room)}
            />
          ))}
          <RoomButton
            room={ELSEWHERE}
            shortcut={ELSEWHERE_KEY}
            blocked={blocked}
            onClick={() => onLabel(ELSEWHERE)}
          />
          <Button compact icon="add" blocked={blocked} onClick={target.askNewRoom}>
            {text.newRoom}
          </Button>
        </div>
      )}
      {target.isAsking && (
        <NewRoom
          onName={(room) => {
            target.stopAsking();
            onLabel(room);
          }}
          onClose={target.stopAsking}
        />
      )}
    </div>
  );
}

interface RoomButtonProps {
  room: string;
  shortcut?: string;
  blocked?: string;
  onClick: () => void;
}

function RoomButton({ room, shortcut, blocked, onClick }: RoomButtonProps) {
  return (
    <Button compact blocked={blocked} class={roomClass(room)} onClick={onClick}>
      <span class="dot" aria-hidden="true" />
      <span class="clip label-room">{room}</span>
      {shortcut !== undefined && <kbd>{shortcut}</kbd>}
    </Button>
  );
}

function NewRoom({ onName, onClose }: { onName: (room: string) => void; onClose: () => void }) {
  const [room, setRoom] = useState("");
  const submit = (event: Event) => {
    event.preventDefault();
    if (room.trim() !== "") onName(named(room));
  };
  return (
    <Dialog title={text.newRoomTitle} onClose={onClose}>
      <form class="stack" onSubmit={submit}>
        <TextField
          label={text.roomName}
          value={room}
          onInput={setRoom}
          maxLength={64}
          required
          autoFocus
        />
        <div class="dialog-foot">
          <Button onClick={onClose}>{common.cancel}</Button>
          <Button kind="primary" type="submit" disabled={room.trim() === ""}>
            {text.label}
          </Button>
        </div>
      </form>
    </Dialog>
  );
}
