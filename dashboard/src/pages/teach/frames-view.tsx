import { useCallback, useMemo, useRef, useState } from "preact/hooks";
import { listFrames, pictureAddress, type DataSet, type Frame } from "../../api/sets";
import { Button } from "../../components/button";
import { FrameGrid } from "../../components/frame-grid";
import { FrameViewer } from "../../components/frame-viewer";
import { EmptyState, ErrorNote } from "../../components/layout";
import { usePaged } from "../../components/paged";
import { kept, meant, NOTHING, type Selection } from "../../components/selection";
import { blockedForData } from "../../session";
import { text } from "../../texts/teach";
import { MoveDialog } from "./move-dialog";
import { RoomHead } from "./room-head";
import { RoomList, type Chosen } from "./room-list";
import type { Changer } from "./changer";

/** So many frames are asked for at once. */
const PAGE = 500;

interface FramesViewProps {
  set: DataSet;
  /** Grows with every change of the set. */
  version: number;
  change: Changer;
}

/** The frames of a set, of all rooms or of one, and what is done to many of them at once. */
export function FramesView({ set, version, change }: FramesViewProps) {
  const [chosen, setChosen] = useState<Chosen>({});
  const [selection, setSelection] = useState<Selection>(NOTHING);
  const [moving, setMoving] = useState<string[] | undefined>(undefined);
  const [opened, setOpened] = useState<number | undefined>(undefined);
  const dragged = useRef<readonly string[]>([]);
  const blocked = blockedForData("admin");

  const paged = usePaged<Frame>(
    async (after, signal) => {
      const { frames, ...page } = await listFrames(set.name, chosen, after, PAGE, signal);
      return { ...page, items: frames };
    },
    [set.name, chosen.room, chosen.drive],
    version,
  );
  const names = useMemo(() => paged.items.map(({ path }) => path), [paged.items]);
  const there = useMemo(() => kept(selection, names), [selection, names]);

  const choose = (next: Chosen) => {
    setChosen(next);
    setSelection(NOTHING);
  };
  const move = async (frames: readonly string[], room: string, drive?: string) => {
    setMoving(undefined);
    if (await change({ action: "move", frames: [...frames], room, drive })) {
      setSelection({ ...there, names: new Set() });
    }
  };
  const remove = async (frames: readonly string[]) => {
    if (frames.length > 0 && (await change({ action: "remove", frames: [...frames] }))) {
      setSelection({ ...there, names: new Set() });
    }
  };
  const selectAll = async () => {
    const all = await paged.all();
    setSelection({ ...there, names: new Set(all.map(({ path }) => path)) });
  };
  const whenPressed = (key: string) => {
    const frames = meant(there, names);
    if (blocked !== undefined || frames.length === 0) return false;
    if (key === "m") setMoving(frames);
    else if (key === "Delete" || key === "Backspace") void remove(frames);
    else return false;
    return true;
  };

  const hasCaptions = chosen.room === undefined;
  const tile = useCallback(
    (_: string, index: number) => tileOf(set.name, paged.items[index], hasCaptions),
    [set.name, paged.items, hasCaptions],
  );

  if (set.rooms.length === 0) {
    return <EmptyState icon="picture" title={text.emptySet} text={text.emptySetText} />;
  }
  const selected = meant({ ...there, focus: -1 }, names);
  const hasSelected = selected.length > 0;
  return (
    <div class="teach">
      <RoomList
        rooms={set.rooms}
        chosen={chosen}
        onChoose={choose}
        onDrop={blocked === undefined ? (room) => void move(dragged.current, room) : undefined}
        onDropNew={() => setMoving([...dragged.current])}
      />
      <section class="teach-frames stack">
        <RoomHead set={set} chosen={chosen} change={change} onChoose={choose} />
        <div class="toolbar" role="toolbar" aria-label={text.selected(selected.length)}>
          <span class="number" aria-live="polite">
            {hasSelected ? text.selected(selected.length) : text.nothingSelected}
          </span>
          <Button
            compact
            blocked={blocked}
            disabled={!hasSelected}
            onClick={() => setMoving(selected)}
          >
            {text.move}
          </Button>
          <Button
            compact
            icon="remove"
            blocked={blocked}
            disabled={!hasSelected}
            onClick={() => void remove(selected)}
          >
            {text.remove}
          </Button>
          <span class="grow" />
          <Button compact kind="plain" onClick={() => void selectAll()}>
            {text.selectAll}
          </Button>
          <Button
            compact
            kind="plain"
            disabled={!hasSelected}
            onClick={() => setSelection({ ...there, names: new Set() })}
          >
            {text.selectNone}
          </Button>
        </div>
        {paged.error !== undefined && <ErrorNote error={paged.error} onRetry={paged.reload} />}
        <FrameGrid
          label={text.gridLabel(chosen.room ?? text.allRooms, paged.total)}
          names={names}
          total={paged.total}
          selection={there}
          captionHeight={hasCaptions ? 22 : 0}
          tile={tile}
          onSelect={setSelection}
          onNeed={paged.need}
          onSelectAll={() => void selectAll()}
          onOpen={(name) => setOpened(names.indexOf(name))}
          onKey={whenPressed}
          onDrag={blocked === undefined ? (frames) => (dragged.current = frames) : undefined}
        />
        <p class="muted small help">{text.gridHelp}</p>
      </section>
      {moving && (
        <MoveDialog
          rooms={set.rooms.map(({ name }) => name)}
          frames={moving.length}
          onMove={(room, drive) => void move(moving, room, drive)}
          onClose={() => setMoving(undefined)}
        />
      )}
      {opened !== undefined && (
        <FrameViewer
          names={names}
          index={opened}
          picture={(path) => pictureAddress(set.name, path)}
          onGo={(index) => {
            setOpened(index);
            setSelection({ ...there, focus: index, anchor: index });
          }}
          onClose={() => setOpened(undefined)}
        />
      )}
    </div>
  );
}

function tileOf(set: string, frame: Frame | undefined, hasCaption: boolean) {
  const { path = "", room = "", drive = "" } = frame ?? {};
  return {
    picture: pictureAddress(set, path, 240),
    label: text.frameLabel(room, drive, path.split("/").at(-1) ?? ""),
    caption: hasCaption ? room : undefined,
  };
}
