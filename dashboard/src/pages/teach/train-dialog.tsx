import { useState } from "preact/hooks";
import { listModels } from "../../api/models";
import { ELSEWHERE, type Room } from "../../api/sets";
import { startTraining, type Camera, type Effort } from "../../api/trainings";
import { Button } from "../../components/button";
import { Dialog } from "../../components/dialog";
import { TextField } from "../../components/fields";
import { ErrorNote, Note } from "../../components/layout";
import { TrainingFields } from "../../components/training-fields";
import { useAction, useLoad } from "../../hooks";
import { go } from "../../route";
import { text as common } from "../../texts/common";
import { text } from "../../texts/teach";
import { trainingHref } from "../models/paths";

const DEFAULT_MODEL = "home";

interface TrainDialogProps {
  set: string;
  /** Those of the set, where they are known. */
  rooms?: Room[];
  /** The model, where it is known. */
  model?: string;
  onClose: () => void;
}

/** Begins a training on a data set, and goes to it. */
export function TrainDialog({ set, rooms, model: given, onClose }: TrainDialogProps) {
  const [typed, setTyped] = useState<string | undefined>(given);
  const [how, setHow] = useState<{ effort: Effort; camera?: Camera }>({ effort: "default" });
  const models = useLoad(listModels, []);
  const model = typed ?? models.data?.default ?? DEFAULT_MODEL;
  // Which model is the default may come after somebody has pressed the button.
  const isOpen = typed === undefined && models.loading && !models.data;
  const hasTooFew = rooms && rooms.filter(({ name }) => name !== ELSEWHERE).length < 2;
  const { run, busy, error } = useAction(async () => {
    const training = await startTraining({ set, model, ...how });
    go(trainingHref(training.id));
  });
  const submit = (event: Event) => {
    event.preventDefault();
    void run();
  };
  return (
    <Dialog title={text.trainTitle(set)} onClose={onClose}>
      <form class="stack" onSubmit={submit}>
        <p class="muted">{text.trainLead}</p>
        {hasTooFew && (
          <Note kind="warn">
            <p>{text.trainTooFew}</p>
          </Note>
        )}
        <TextField
          label={text.trainModel}
          hint={text.trainModelHint}
          value={model}
          onInput={setTyped}
          suggestions={models.data?.models.map(({ name }) => name)}
          required
          maxLength={64}
        />
        <TrainingFields {...how} onChange={(part) => setHow({ ...how, ...part })} />
        {error !== undefined && <ErrorNote error={error} />}
        <div class="dialog-foot">
          <Button onClick={onClose}>{common.cancel}</Button>
          <Button kind="primary" type="submit" busy={busy} disabled={hasTooFew || isOpen}>
            {text.trainStart}
          </Button>
        </div>
      </form>
    </Dialog>
  );
}
