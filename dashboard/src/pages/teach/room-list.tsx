import { useState } from "preact/hooks";
import { ELSEWHERE, type Room } from "../../api/sets";
import { FRAMES_TYPE } from "../../components/frame-grid";
import { Icon } from "../../components/icons";
import { count } from "../../format";
import { roomClass } from "../../rooms";
import { text } from "../../texts/teach";

/** Of which room and drive frames are shown. */
export interface Chosen {
  room?: string;
  drive?: string;
}

interface RoomListProps {
  rooms: Room[];
  chosen: Chosen;
  onChoose: (chosen: Chosen) => void;
  /** Frames were dropped on a room. */
  onDrop?: (room: string) => void;
  onDropNew: () => void;
}

/** The rooms of a set; frames are dragged onto them. */
export function RoomList({ rooms, chosen, onChoose, onDrop, onDropNew }: RoomListProps) {
  const all = rooms.reduce((sum, room) => sum + room.frames, 0);
  return (
    <nav class="rooms" aria-label={text.roomsLabel}>
      <ul>
        <RoomEntry
          label={text.allRooms}
          frames={all}
          isChosen={chosen.room === undefined}
          onChoose={() => onChoose({})}
        />
        {rooms.map((room) => (
          <RoomEntry
            key={room.name}
            label={room.name}
            color={roomClass(room.name)}
            hint={room.name === ELSEWHERE ? text.elsewhereHint : undefined}
            frames={room.frames}
            isChosen={chosen.room === room.name}
            onChoose={() => onChoose({ room: room.name })}
            onDrop={onDrop && (() => onDrop(room.name))}
          />
        ))}
        {onDrop && <NewRoomTarget onDrop={onDropNew} />}
      </ul>
    </nav>
  );
}

/** What an element needs so that frames can be dropped on it. */
function useTarget(onDrop: (() => void) | undefined) {
  const [isOver, setOver] = useState(false);
  const handlers = onDrop && {
    onDragOver: (event: DragEvent) => {
      if (!event.dataTransfer?.types.includes(FRAMES_TYPE)) return;
      event.preventDefault();
      setOver(true);
    },
    onDragLeave: () => setOver(false),
    onDrop: (event: DragEvent) => {
      if (!event.dataTransfer?.types.includes(FRAMES_TYPE)) return;
      event.preventDefault();
      setOver(false);
      onDrop();
    },
  };
  return { isOver, handlers };
}

interface RoomEntryProps {
  label: string;
  frames: number;
  isChosen: boolean;
  color?: string;
  hint?: string;
  onChoose: () => void;
  onDrop?: () => void;
}

function RoomEntry(props: RoomEntryProps) {
  const { isOver, handlers } = useTarget(props.onDrop);
  return (
    <li class={isOver ? "over" : undefined} {...handlers}>
      <button
        type="button"
        aria-current={props.isChosen ? "true" : undefined}
        title={props.hint ?? props.label}
        onClick={props.onChoose}
      >
        <span class={`dot ${props.color ?? ""}`} aria-hidden="true" />
        <span class="grow clip">{props.label}</span>
        <span class="number muted">{count(props.frames)}</span>
      </button>
    </li>
  );
}

function NewRoomTarget({ onDrop }: { onDrop: () => void }) {
  const { isOver, handlers } = useTarget(onDrop);
  return (
    <li class={isOver ? "target over" : "target"} {...handlers}>
      <span>
        <Icon name="add" size={14} /> {text.dropToNewRoom}
      </span>
    </li>
  );
}
