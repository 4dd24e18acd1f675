import { useState } from "preact/hooks";
import { getPolicy, putPolicy, STEPS, type Policy } from "../../api/inbox";
import { listModels } from "../../api/models";
import { listSets } from "../../api/sets";
import { Button } from "../../components/button";
import { CheckField, SelectField, TextField } from "../../components/fields";
import { Busy, ErrorNote, Note } from "../../components/layout";
import { Radios } from "../../components/radios";
import { toast } from "../../components/toast";
import { TrainingFields } from "../../components/training-fields";
import { useAction, useLoad } from "../../hooks";
import { blockedForData } from "../../session";
import { text } from "../../texts/inbox";

const FIRST_AFTER = 20;

/** What happens by itself once frames were labeled. */
export function PolicyForm() {
  const { data, error, reload, set } = useLoad(getPolicy, []);
  if (data) return <PolicyFields policy={data} onSaved={set} />;
  return error === undefined ? <Busy /> : <ErrorNote error={error} onRetry={reload} />;
}

interface PolicyFieldsProps {
  policy: Policy;
  onSaved: (policy: Policy) => void;
}

function PolicyFields({ policy, onSaved }: PolicyFieldsProps) {
  const [draft, setDraft] = useState(policy);
  const sets = useLoad(listSets, []);
  const models = useLoad(listModels, []);
  const setNames = sets.data?.sets.map(({ name }) => name) ?? [];
  const setName = draft.set ?? setNames[0] ?? "";
  const model = draft.model ?? models.data?.default ?? "";
  const trains = draft.train_after > 0;
  const { run, busy, error } = useAction(async () => {
    const saved = await putPolicy(trains ? { ...draft, set: setName, model } : draft);
    onSaved(saved);
    setDraft(saved);
    toast({ text: text.saved });
  });
  const change = (part: Partial<Policy>) => setDraft({ ...draft, ...part });
  const submit = (event: Event) => {
    event.preventDefault();
    void run();
  };
  return (
    <form class="card padded stack form" onSubmit={submit}>
      <p>{text.policyLead}</p>
      <CheckField
        label={text.policyTrain}
        checked={trains}
        onChange={(wanted) => change({ train_after: wanted ? FIRST_AFTER : 0 })}
      />
      {trains && (
        <>
          <div class="fields">
            <TextField
              type="number"
              label={text.policyAfter}
              hint={text.policyAfterHint}
              min={1}
              required
              value={String(draft.train_after)}
              onInput={(n) => change({ train_after: Math.max(1, Number(n)) })}
            />
            <SelectField
              label={text.policySet}
              value={setName}
              options={setNames.map((name) => ({ value: name, label: name }))}
              onChange={(name) => change({ set: name })}
            />
            <TextField
              label={text.policyModel}
              value={model}
              onInput={(name) => change({ model: name })}
              suggestions={models.data?.models.map(({ name }) => name)}
              required
            />
            <TrainingFields effort={draft.effort} camera={draft.camera} onChange={change} />
          </div>
          <Radios
            legend={text.policyPublish}
            value={draft.publish}
            options={STEPS.map((value) => ({ value, label: text.policySteps[value] }))}
            onChange={(publish) => change({ publish })}
          />
          {(draft.publish === "canary" || draft.publish === "stable") && (
            <Note kind="warn">
              <p>{text.policyWarn}</p>
            </Note>
          )}
        </>
      )}
      {error !== undefined && <ErrorNote error={error} />}
      <div class="row">
        <Button kind="primary" type="submit" busy={busy} blocked={blockedForData("admin")}>
          {text.save}
        </Button>
      </div>
    </form>
  );
}
