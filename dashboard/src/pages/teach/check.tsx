import { useState } from "preact/hooks";
import { getCheck, pictureAddress, startCheck, type DataSet, type Finding } from "../../api/sets";
import { Button } from "../../components/button";
import { Busy, ErrorNote, Note } from "../../components/layout";
import { Picture } from "../../components/picture";
import { dateTime } from "../../format";
import { useAction, useLoad } from "../../hooks";
import { blockedForData } from "../../session";
import { text } from "../../texts/teach";
import { MoveDialog } from "./move-dialog";
import type { Changer } from "./changer";

const POLL_MS = 1500;
/** Findings of one kind that are drawn at first. */
const FIRST = 24;

interface CheckViewProps {
  set: DataSet;
  change: Changer;
}

/** What is odd about the pictures of a set, and what to do about it. */
export function CheckView({ set, change }: CheckViewProps) {
  const [isRunning, setRunning] = useState(false);
  const [settled, setSettled] = useState<ReadonlySet<string>>(new Set());
  const { data, error, reload, ...loaded } = useLoad(
    async (signal) => {
      const check = await getCheck(set.name, signal);
      setRunning(check.state === "running");
      return check;
    },
    [set.name],
    isRunning ? POLL_MS : undefined,
  );
  const start = useAction(async () => {
    const check = await startCheck(set.name);
    setSettled(new Set());
    loaded.set(check);
    setRunning(check.state === "running");
  });

  const settle = (finding: Finding) => setSettled(new Set([...settled, keyOf(finding)]));
  const fix = async (finding: Finding, room?: string) => {
    const frames = [finding.path];
    const done = await change(
      room === undefined ? { action: "remove", frames } : { action: "move", frames, room },
    );
    if (done) settle(finding);
  };

  if (!data) return error === undefined ? <Busy /> : <ErrorNote error={error} onRetry={reload} />;
  const open = data.findings.filter((finding) => !settled.has(keyOf(finding)));
  const last = set.changes.find(({ undone }) => !undone);
  const isStale = data.at !== undefined && last !== undefined && last.at > data.at;
  return (
    <>
      <div class="row">
        <p class="muted measure">{text.checkLead}</p>
        <span class="grow" />
        <Button
          icon="search"
          kind={data.state === "none" ? "primary" : undefined}
          blocked={blockedForData("admin")}
          busy={start.busy || data.state === "running"}
          onClick={() => void start.run()}
        >
          {data.state === "none" ? text.checkStart : text.checkAgain}
        </Button>
      </div>
      {start.error !== undefined && <ErrorNote error={start.error} />}
      {error !== undefined && <ErrorNote error={error} onRetry={reload} />}
      {data.state === "running" && <Busy label={text.checkRunning(data.n_frames)} />}
      {data.state === "failed" && (
        <Note kind="bad">
          <p>
            {text.checkFailed}: {data.error}
          </p>
        </Note>
      )}
      {data.state === "done" && (
        <Note kind={open.length === 0 ? "good" : "warn"}>
          <p>
            {text.checkedAt(dateTime(data.at), data.n_frames ?? 0)}{" "}
            {open.length === 0 ? text.checkNothing : text.checkFound(open.length)}{" "}
            {isStale && text.checkStale}
          </p>
        </Note>
      )}
      {grouped(open).map(({ heading, findings }) => (
        <FindingGroup
          key={heading}
          set={set}
          heading={heading}
          findings={findings}
          onFix={fix}
          onKeep={settle}
        />
      ))}
    </>
  );
}

const keyOf = ({ oddity, path, other }: Finding) => [oddity, path, other].join("\n");

interface Group {
  heading: string;
  findings: Finding[];
}

/** Findings of the same kind together, in the order in which they came. */
function grouped(findings: Finding[]): Group[] {
  const groups = new Map<string, Finding[]>();
  for (const finding of findings) {
    groups.set(finding.heading, [...(groups.get(finding.heading) ?? []), finding]);
  }
  return [...groups].map(([heading, of]) => ({ heading, findings: of }));
}

interface FindingGroupProps extends Group {
  set: DataSet;
  onFix: (finding: Finding, room?: string) => Promise<void>;
  onKeep: (finding: Finding) => void;
}

function FindingGroup({ set, heading, findings, onFix, onKeep }: FindingGroupProps) {
  const [most, setMost] = useState(FIRST);
  return (
    <section class="stack">
      <h3>
        {heading} <span class="muted number">({findings.length})</span>
      </h3>
      <ul class="findings">
        {findings.slice(0, most).map((finding) => (
          <FindingCard
            key={keyOf(finding)}
            set={set}
            finding={finding}
            onFix={onFix}
            onKeep={onKeep}
          />
        ))}
      </ul>
      {findings.length > most && (
        <div>
          <Button onClick={() => setMost(most + 4 * FIRST)}>
            {text.checkMore(findings.length - most)}
          </Button>
        </div>
      )}
    </section>
  );
}

interface FindingCardProps {
  set: DataSet;
  finding: Finding;
  onFix: (finding: Finding, room?: string) => Promise<void>;
  onKeep: (finding: Finding) => void;
}

function FindingCard({ set, finding, onFix, onKeep }: FindingCardProps) {
  const [isMoving, setMoving] = useState(false);
  const blocked = blockedForData("admin");
  const { path, room, detail, other, likely_room: likely } = finding;
  const picture = (of: string) => pictureAddress(set.name, of, 320);
  return (
    <li class="card finding">
      <div class={other === undefined ? "finding-pictures" : "finding-pictures two"}>
        <Picture src={picture(path)} alt={path} />
        {other !== undefined && <Picture src={picture(other)} alt={text.otherOf(other)} />}
      </div>
      <div class="finding-body stack">
        <div>
          <p class="clip" title={path}>
            <strong>{path}</strong>
          </p>
          <p class="muted small">
            {text.findingRoom(room)}
            {detail !== "" && `; ${detail}`}
          </p>
          {other !== undefined && (
            <p class="muted small clip" title={other}>
              {text.otherOf(other)}
            </p>
          )}
        </div>
        <div class="row">
          {likely !== undefined && likely !== room && (
            <Button
              compact
              kind="primary"
              blocked={blocked}
              onClick={() => void onFix(finding, likely)}
            >
              {text.moveTo(likely)}
            </Button>
          )}
          <Button compact blocked={blocked} onClick={() => setMoving(true)}>
            {text.move}
          </Button>
          <Button compact icon="remove" blocked={blocked} onClick={() => void onFix(finding)}>
            {text.remove}
          </Button>
          <Button compact kind="plain" onClick={() => onKeep(finding)}>
            {text.keep}
          </Button>
        </div>
      </div>
      {isMoving && (
        <MoveDialog
          rooms={set.rooms.map(({ name }) => name).filter((name) => name !== room)}
          frames={1}
          onMove={(to) => {
            setMoving(false);
            void onFix(finding, to);
          }}
          onClose={() => setMoving(false)}
        />
      )}
    </li>
  );
}
