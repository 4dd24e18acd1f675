import { useCallback, useEffect, useMemo, useState } from "preact/hooks";
import { discardFrames, inboxPicture, labelFrames, listInbox } from "../../api/inbox";
import type { Conflict, InboxFrame, InboxQuery } from "../../api/inbox";
import { undoChange } from "../../api/sets";
import { Button } from "../../components/button";
import { confirm } from "../../components/dialog";
import { FrameGrid } from "../../components/frame-grid";
import { FrameViewer } from "../../components/frame-viewer";
import { EmptyState, ErrorNote, Note } from "../../components/layout";
import { usePaged } from "../../components/paged";
import { kept, meant, NOTHING, type Selection } from "../../components/selection";
import { toast, toastError } from "../../components/toast";
import { percent } from "../../format";
import { useLoad } from "../../hooks";
import { inboxOpen } from "../../inbox-count";
import { roomClass } from "../../rooms";
import { blockedForData } from "../../session";
import { text } from "../../texts/inbox";
import { Conflicts } from "./conflicts";
import { Filters, fromRoute } from "./filters";
import { FocusPanel } from "./focus-panel";
import { LabelBar, useTarget } from "./label-bar";

/** So many frames are asked for at once. */
const PAGE = 500;
const LOOK_MS = 10_000;

/** The frames of the inbox, and what they show said for many of them at once. */
export function FramesView() {
  const [query, setQuery] = useState<InboxQuery>(fromRoute);
  const [selection, setSelection] = useState<Selection>(NOTHING);
  const [conflicts, setConflicts] = useState<Conflict[]>([]);
  const [opened, setOpened] = useState<number | undefined>(undefined);
  const target = useTarget();
  const blocked = blockedForData("admin");
  const inputs = [query.state, query.reason, query.robot, query.room, query.sort];
  const paged = usePaged<InboxFrame>(async (after, signal) => {
    const { frames, total, open, next } = await listInbox(query, after, PAGE, signal);
    inboxOpen.value = open;
    return { total, items: frames, next: next?.toString() };
  }, inputs);
  // The list stays as it is under the reader's hand; what came since is told.
  const now = useLoad((signal) => listInbox(query, undefined, 1, signal), inputs, LOOK_MS);
  const fresh = now.data && !paged.loading ? Math.abs(now.data.total - paged.total) : 0;

  const names = useMemo(() => paged.items.map(({ id }) => String(id)), [paged.items]);
  const there = useMemo(() => kept(selection, names), [selection, names]);
  const focused = paged.items[there.focus];
  useEffect(() => setSelection(NOTHING), inputs);

  const reload = () => {
    paged.reload();
    now.reload();
  };
  const asSeen = (chosen: readonly string[]) => {
    const wanted = new Set(chosen);
    return paged.items
      .filter(({ id }) => wanted.has(String(id)))
      .map(({ id, revision }) => ({ id, revision }));
  };
  const clear = () => setSelection({ ...there, names: new Set() });

  const label = async (room: string, chosen = meant(there, names)) => {
    const frames = asSeen(chosen);
    const { set } = target;
    if (blocked !== undefined || set === undefined || frames.length === 0) return;
    try {
      const done = await labelFrames(set, room, frames);
      const undo = async () => {
        for (const change of done.changes.toReversed()) await undoChange(set, change);
        reload();
      };
      if (done.labeled.length > 0) {
        toast({
          text: text.labeled(done.labeled.length, room, set),
          undo: done.changes.length > 0 ? undo : undefined,
        });
      }
      setConflicts(done.conflicts);
      clear();
      target.reload();
    } catch (error) {
      toastError(error);
    }
    reload();
  };
  const discard = async () => {
    const frames = asSeen(meant(there, names));
    const { length } = frames;
    const question = {
      title: text.discardTitle(length),
      text: text.discardText,
      action: text.discard,
      danger: true,
    };
    if (blocked !== undefined || length === 0 || !(await confirm(question))) return;
    try {
      const discarded = await discardFrames(frames);
      toast({ text: text.discarded(discarded) });
      clear();
    } catch (error) {
      toastError(error);
    }
    reload();
  };
  const selectAll = async () => {
    const all = await paged.all();
    setSelection({ ...there, names: new Set(all.map(({ id }) => String(id))) });
  };
  const whenPressed = (key: string) => {
    const room = target.roomOfKey(key);
    if (room !== undefined) void label(room);
    else if (key === "n") target.askNewRoom();
    else if (key === "Delete" || key === "Backspace") void discard();
    else return false;
    return true;
  };

  const tile = useCallback((_: string, index: number) => tileOf(paged.items[index]), [paged.items]);
  const isEmpty = paged.total === 0 && !paged.loading && paged.error === undefined;
  return (
    <>
      <Filters query={query} frames={paged.items} onChange={setQuery} />
      {fresh > 0 && (
        <Note>
          <p>{text.fresh(fresh)}</p>
          <Button compact onClick={reload}>
            {text.showFresh}
          </Button>
        </Note>
      )}
      {paged.error !== undefined && <ErrorNote error={paged.error} onRetry={paged.reload} />}
      {isEmpty ? (
        <EmptyState icon="inbox" title={text.none} text={text.noneText} />
      ) : (
        <>
          <LabelBar
            target={target}
            selected={there.names.size}
            onLabel={(room) => void label(room)}
            onDiscard={() => void discard()}
            onSelectAll={() => void selectAll()}
            onSelectNone={clear}
          />
          <div class="inbox">
            <div class="stack">
              <FrameGrid
                label={text.gridLabel(paged.total)}
                names={names}
                total={paged.total}
                selection={there}
                captionHeight={40}
                tileWidth={160}
                tile={tile}
                onSelect={setSelection}
                onNeed={paged.need}
                onSelectAll={() => void selectAll()}
                onOpen={(name) => setOpened(names.indexOf(name))}
                onKey={whenPressed}
              />
              <p class="muted small help">{text.gridHelp}</p>
            </div>
            {focused && (
              <FocusPanel
                key={focused.id}
                frame={focused}
                set={target.set}
                onLabel={(room) => void label(room, [String(focused.id)])}
                onEnlarge={() => setOpened(there.focus)}
              />
            )}
          </div>
        </>
      )}
      {conflicts.length > 0 && (
        <Conflicts
          conflicts={conflicts}
          onShow={() => {
            setConflicts([]);
            setQuery({ state: "labeled", sort: "newest" });
          }}
          onClose={() => setConflicts([])}
        />
      )}
      {opened !== undefined && (
        <FrameViewer
          names={names}
          index={opened}
          picture={(id) => inboxPicture(Number(id))}
          onGo={(index) => {
            setOpened(index);
            setSelection({ ...there, focus: index, anchor: index });
          }}
          onClose={() => setOpened(undefined)}
        />
      )}
    </>
  );
}

function tileOf(frame: InboxFrame | undefined) {
  if (!frame) return { picture: "", label: "" };
  const { id, room, probability, reasons, label } = frame;
  const why = reasons.map((reason) => text.reasons[reason]).join(", ");
  return {
    picture: inboxPicture(id, 240),
    label: label ? text.labeledAs(label.room) : text.frameLabel(room, percent(probability), why),
    mark: label && <span class="frame-mark">{text.labeledAs(label.room)}</span>,
    caption: (
      <>
        <span class={`frame-room ${roomClass(room)}`}>
          <span class="dot" aria-hidden="true" />
          <span class="grow clip">{room}</span>
          <span class="number">{percent(probability)}</span>
        </span>
        <span class="muted clip">{why}</span>
      </>
    ),
  };
}
