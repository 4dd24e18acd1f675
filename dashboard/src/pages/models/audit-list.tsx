import { useState } from "preact/hooks";
import { listAudit, type AuditEntry } from "../../api/audit";
import { Button } from "../../components/button";
import { Busy, ErrorNote } from "../../components/layout";
import { dateTime } from "../../format";
import { useAction, useLoad } from "../../hooks";
import { text } from "../../texts/models";

const PAGE = 50;

/** Who did what, the last first. */
export function Audit() {
  const first = useLoad((signal) => listAudit(undefined, PAGE, signal), []);
  const [older, setOlder] = useState<AuditEntry[]>([]);
  const [next, setNext] = useState<number | "none" | undefined>(undefined);
  const before = next ?? first.data?.next;
  const more = useAction(async () => {
    if (typeof before !== "number") return;
    const page = await listAudit(before, PAGE);
    setOlder([...older, ...page.entries]);
    setNext(page.next ?? "none");
  });
  if (!first.data) {
    return first.error === undefined ? (
      <Busy />
    ) : (
      <ErrorNote error={first.error} onRetry={first.reload} />
    );
  }
  const entries = [...first.data.entries, ...older];
  if (entries.length === 0) return <p class="muted">{text.noAudit}</p>;
  return (
    <>
      <div class="card table-wrap">
        <table class="table">
          <thead>
            <tr>
              <th scope="col">{text.when}</th>
              <th scope="col">{text.who}</th>
              <th scope="col">{text.what}</th>
              <th scope="col">{text.target}</th>
            </tr>
          </thead>
          <tbody>
            {entries.map(({ id, at, who, what, target, detail }) => (
              <tr key={id}>
                <td class="number">{dateTime(at)}</td>
                <td>{who}</td>
                <td>{text.auditWhat[what] ?? what}</td>
                <td class="wrap">
                  {target}
                  {detail && <span class="muted"> {detail}</span>}
                </td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
      {more.error !== undefined && <ErrorNote error={more.error} />}
      {typeof before === "number" && (
        <div>
          <Button busy={more.busy} onClick={() => void more.run()}>
            {text.more}
          </Button>
        </div>
      )}
    </>
  );
}
