import { useState } from "preact/hooks";
import { createSet, listSets, removeSet, type SetSummary } from "../../api/sets";
import { Button } from "../../components/button";
import { confirm, Dialog } from "../../components/dialog";
import { TextField } from "../../components/fields";
import { Busy, EmptyState, ErrorNote, PageHead } from "../../components/layout";
import { toast, toastError } from "../../components/toast";
import { bytes, dateTime } from "../../format";
import { useAction, useLoad } from "../../hooks";
import { go, href } from "../../route";
import { blockedForData } from "../../session";
import { text as common } from "../../texts/common";
import { text } from "../../texts/teach";

const NAME = /^[A-Za-z0-9][A-Za-z0-9._-]{0,63}$/;

/** All data sets. */
export function SetsPage() {
  const [isMaking, setMaking] = useState(false);
  const { data, error, reload } = useLoad(listSets, [], 15_000);
  const make = (
    <Button
      kind="primary"
      icon="add"
      blocked={blockedForData("admin")}
      onClick={() => setMaking(true)}
    >
      {text.newSet}
    </Button>
  );
  return (
    <>
      <PageHead title={text.title} lead={text.lead}>
        <span class="grow" />
        {data && data.sets.length > 0 && make}
      </PageHead>
      {error !== undefined && <ErrorNote error={error} onRetry={reload} />}
      {!data && error === undefined && <Busy />}
      {data?.sets.length === 0 && (
        <EmptyState icon="teach" title={text.noSets} text={text.noSetsText}>
          {make}
        </EmptyState>
      )}
      <ul class="sets">
        {data?.sets.map((set) => (
          <SetCard key={set.name} set={set} onRemoved={reload} />
        ))}
      </ul>
      {isMaking && <NewSet onClose={() => setMaking(false)} />}
    </>
  );
}

function SetCard({ set, onRemoved }: { set: SetSummary; onRemoved: () => void }) {
  const remove = async () => {
    const question = {
      title: text.removeSetTitle(set.name),
      text: text.removeSetText(set.frames),
      action: text.removeSet,
      danger: true,
    };
    if (!(await confirm(question))) return;
    try {
      await removeSet(set.name);
      toast({ text: text.setRemoved(set.name) });
    } catch (error) {
      toastError(error);
    }
    onRemoved();
  };
  return (
    <li class="card set-card">
      <div class="row">
        <h2 class="grow clip">
          <a href={href("teach", set.name)}>{set.name}</a>
        </h2>
        <Button
          kind="plain"
          compact
          icon="remove"
          label={`${text.removeSet} ${set.name}`}
          blocked={blockedForData("admin")}
          onClick={() => void remove()}
        />
      </div>
      <p class="number">
        {text.rooms(set.rooms)} · {text.frames(set.frames)} · {bytes(set.bytes)}
      </p>
      {set.changed_at && <p class="muted small">{text.changedAt(dateTime(set.changed_at))}</p>}
    </li>
  );
}

function NewSet({ onClose }: { onClose: () => void }) {
  const [name, setName] = useState("");
  const [isTold, setTold] = useState(false);
  const wrong = isTold && !NAME.test(name) ? text.setNameWrong : undefined;
  const { run, busy, error } = useAction(async () => {
    await createSet(name);
    go(href("teach", name));
  });
  const submit = (event: Event) => {
    event.preventDefault();
    setTold(true);
    if (NAME.test(name)) void run();
  };
  return (
    <Dialog title={text.newSet} onClose={onClose}>
      <form class="stack" onSubmit={submit}>
        <TextField
          label={text.setName}
          hint={text.setNameHint}
          wrong={wrong}
          value={name}
          onInput={setName}
          maxLength={64}
          autoFocus
        />
        {error !== undefined && <ErrorNote error={error} />}
        <div class="dialog-foot">
          <Button onClick={onClose}>{common.cancel}</Button>
          <Button kind="primary" type="submit" icon="add" busy={busy}>
            {text.create}
          </Button>
        </div>
      </form>
    </Dialog>
  );
}
