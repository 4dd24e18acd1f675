import { useState } from "preact/hooks";
import { changeSet, getSet, undoChange } from "../../api/sets";
import { BackLink } from "../../components/back-link";
import { Button } from "../../components/button";
import { Busy, ErrorNote, Note, PageHead } from "../../components/layout";
import { Tabs } from "../../components/tabs";
import { toast, toastError } from "../../components/toast";
import { useLoad } from "../../hooks";
import { go, href } from "../../route";
import { blockedForData } from "../../session";
import { text } from "../../texts/teach";
import type { Changer } from "./changer";
import { Changes } from "./changes";
import { CheckView } from "./check";
import { FramesView } from "./frames-view";
import { hasFiles, readDropped, type DroppedFile } from "./dropped";
import { TrainDialog } from "./train-dialog";
import { UploadDialog } from "./upload-dialog";

const TABS = ["frames", "check", "changes"] as const;
type Tab = (typeof TABS)[number];

/** One data set. */
export function SetPage({ name, part }: { name: string; part?: string }) {
  const [dialog, setDialog] = useState<"upload" | "train" | undefined>(undefined);
  const [dropped, setDropped] = useState<DroppedFile[]>([]);
  const [isOver, setOver] = useState(false);
  // Counts changes: what shows frames loads them again.
  const [version, setVersion] = useState(0);
  const { data: set, error, reload } = useLoad((signal) => getSet(name, signal), [name], 15_000);
  const tab: Tab = TABS.find((one) => one === part) ?? "frames";
  const blocked = blockedForData("admin");

  const changed = () => {
    reload();
    setVersion((n) => n + 1);
  };

  const undo = async (change: number) => {
    const undone = await undoChange(name, change);
    toast({ text: text.undoDone(undone.text) });
    changed();
  };

  const change: Changer = async (request) => {
    try {
      const done = await changeSet(name, request);
      toast({ text: done.text, undo: () => undo(done.id) });
      return true;
    } catch (problem) {
      toastError(problem);
      return false;
    } finally {
      changed();
    }
  };

  const whenDropped = async (event: DragEvent) => {
    setOver(false);
    if (!hasFiles(event) || blocked !== undefined || !event.dataTransfer) return;
    event.preventDefault();
    setDropped(await readDropped(event.dataTransfer));
    setDialog("upload");
  };

  return (
    <div
      class={isOver ? "set-page over" : "set-page"}
      onDragOver={(event) => {
        if (!hasFiles(event)) return;
        event.preventDefault();
        setOver(true);
      }}
      onDragLeave={(event) => {
        if (!event.currentTarget.contains(event.relatedTarget as Node | null)) setOver(false);
      }}
      onDrop={(event) => void whenDropped(event)}
    >
      <PageHead title={name}>
        <BackLink href={href("teach")} label={text.back} />
        <span class="grow" />
        <Button
          kind="primary"
          icon="camera"
          blocked={blocked}
          onClick={() => go(href("teach", name, "record"))}
        >
          {text.record}
        </Button>
        <Button icon="upload" blocked={blocked} onClick={() => setDialog("upload")}>
          {text.addPictures}
        </Button>
        <Button icon="models" blocked={blocked} onClick={() => setDialog("train")}>
          {text.train}
        </Button>
      </PageHead>
      {error !== undefined && <ErrorNote error={error} onRetry={reload} />}
      {!set && error === undefined && <Busy />}
      {set && (
        <Tabs
          label={text.tabsLabel}
          tabs={TABS.map((id) => ({ id, label: text.tabs[id] }))}
          chosen={tab}
          onChoose={(id) => go(href("teach", name, id), true)}
        >
          <div class="tab-body stack">
            {tab === "frames" && (
              <>
                <Advice advice={set.advice} leftOut={set.left_out} />
                <FramesView set={set} version={version} change={change} />
              </>
            )}
            {tab === "check" && <CheckView set={set} change={change} />}
            {tab === "changes" && <Changes changes={set.changes} undo={undo} />}
          </div>
        </Tabs>
      )}
      {dialog === "upload" && (
        <UploadDialog
          set={name}
          rooms={set?.rooms.map((room) => room.name) ?? []}
          files={dropped}
          onAdded={changed}
          onClose={() => {
            setDialog(undefined);
            setDropped([]);
          }}
        />
      )}
      {dialog === "train" && set && (
        <TrainDialog set={name} rooms={set.rooms} onClose={() => setDialog(undefined)} />
      )}
    </div>
  );
}

interface AdviceProps {
  advice: string[];
  leftOut: { path: string; reason: string }[];
}

function Advice({ advice, leftOut }: AdviceProps) {
  return (
    <>
      {advice.length > 0 && (
        <Note kind="warn">
          <details class="advice">
            <summary>
              <strong>{text.advice}</strong> <span class="muted">{advice.length}</span>
            </summary>
            <ul>
              {advice.map((line) => (
                <li key={line}>{line}</li>
              ))}
            </ul>
          </details>
        </Note>
      )}
      {leftOut.length > 0 && (
        <Note>
          <details class="advice">
            <summary>{text.leftOut(leftOut.length)}</summary>
            <ul>
              {leftOut.map(({ path, reason }) => (
                <li key={path}>
                  <code>{path}</code>: {reason}
                </li>
              ))}
            </ul>
          </details>
        </Note>
      )}
    </>
  );
}
