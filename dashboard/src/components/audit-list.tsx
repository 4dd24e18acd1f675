import { useState } from "preact/hooks";
import { type AuditEntry, listAudit } from "../api/audit";
import { dateTime } from "../format";
import { useAction, useLoad } from "../hooks";
import { service } from "../session";
import { text } from "../texts/audit";
import { text as common } from "../texts/common";
import { Button } from "./button";
import { Busy, EmptyState, ErrorNote } from "./layout";
import { Table } from "./table";

const PAGE = 100;

/** Who changed what, the newest first. */
export function Audit() {
  if (service.value?.data === false) {
    return <EmptyState icon="service" title={text.notKept} text={common.noData} />;
  }
  return <AuditList />;
}

function AuditList() {
  const first = useLoad((signal) => listAudit(undefined, PAGE, signal), []);
  const [older, setOlder] = useState<{ entries: AuditEntry[]; next?: number }>();
  const next = older ? older.next : first.data?.next;
  const more = useAction(async () => {
    const page = await listAudit(next, PAGE);
    setOlder((before) => ({
      entries: [...(before?.entries ?? []), ...page.entries],
      next: page.next,
    }));
  });
  const entries = [...(first.data?.entries ?? []), ...(older?.entries ?? [])];
  return (
    <div class="stack">
      <p class="muted">{text.lead}</p>
      {first.error !== undefined && <ErrorNote error={first.error} onRetry={first.reload} />}
      {!first.data && first.loading && <Busy />}
      {first.data && entries.length === 0 && <EmptyState icon="check" title={text.none} />}
      {entries.length > 0 && (
        <div class="card padded">
          <Table
            label={text.title}
            head={[text.when, text.who, text.what, text.target, text.detail]}
            rows={entries.map(({ id, at, who, what, target, detail }) => ({
              key: String(id),
              cells: [
                <span class="number">{dateTime(at)}</span>,
                who || text.anyone,
                text.actions[what] ?? what,
                target,
                detail,
              ],
            }))}
          />
        </div>
      )}
      {more.error !== undefined && <ErrorNote error={more.error} />}
      {next !== undefined && (
        <div class="row">
          <Button busy={more.busy} onClick={() => void more.run()}>
            {text.older}
          </Button>
        </div>
      )}
    </div>
  );
}
