import type { Change } from "../../api/sets";
import { Button } from "../../components/button";
import { Badge } from "../../components/layout";
import { toastError } from "../../components/toast";
import { dateTime } from "../../format";
import { useAction } from "../../hooks";
import { blockedForData } from "../../session";
import { text as common } from "../../texts/common";
import { text } from "../../texts/teach";

interface ChangesProps {
  changes: Change[];
  undo: (change: number) => Promise<void>;
}

/** What was done to a set; the last change that stands can be undone. */
export function Changes({ changes, undo }: ChangesProps) {
  const { run, busy } = useAction(async (change: number) => {
    await undo(change).catch(toastError);
  });
  const last = changes.find((change) => !change.undone);
  if (changes.length === 0) return <p class="muted">{text.noChanges}</p>;
  return (
    <>
      <p class="muted">{text.changesLead}</p>
      <div class="card table-wrap">
        <table class="table">
          <thead>
            <tr>
              <th scope="col">{text.when}</th>
              <th scope="col">{text.who}</th>
              <th scope="col">{text.what}</th>
              <th scope="col">
                <span class="hidden">{common.undo}</span>
              </th>
            </tr>
          </thead>
          <tbody>
            {changes.map((change) => (
              <tr key={change.id}>
                <td class="number">{dateTime(change.at)}</td>
                <td>{change.by}</td>
                <td class="wrap">{change.text}</td>
                <td>
                  {change.undone && <Badge>{text.undone}</Badge>}
                  {change === last && (
                    <Button
                      compact
                      icon="undo"
                      busy={busy}
                      blocked={blockedForData("admin")}
                      onClick={() => void run(change.id)}
                    >
                      {common.undo}
                    </Button>
                  )}
                </td>
              </tr>
            ))}
          </tbody>
        </table>
      </div>
    </>
  );
}
