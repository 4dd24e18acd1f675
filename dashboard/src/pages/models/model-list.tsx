import { useState } from "preact/hooks";
import { listModels, type ModelInfo } from "../../api/models";
import { listSets } from "../../api/sets";
import { listTrainings, type Training } from "../../api/trainings";
import { Button } from "../../components/button";
import { Dialog } from "../../components/dialog";
import { SelectField } from "../../components/fields";
import { Badge, Busy, ErrorNote } from "../../components/layout";
import { NoModel } from "../../components/no-model";
import { useLoad } from "../../hooks";
import { blockedFor, blockedForData } from "../../session";
import { text as common } from "../../texts/common";
import { text } from "../../texts/models";
import { TrainDialog } from "../teach/train-dialog";
import { useChanger } from "./changer";
import { RunningTraining } from "./running-training";
import { VersionRow } from "./version-row";

const EVERY_MS = 4000;
/** Versions that are drawn at first, beside those with a label. */
const FIRST = 5;

/** All models with their versions. */
export function ModelList() {
  const { data, error, reload } = useLoad(listModels, [], EVERY_MS);
  // Without a data directory there are none, which the other pages tell.
  const trainings = useLoad(
    async (signal) => await listTrainings(signal).catch(() => [] as Training[]),
    [],
    EVERY_MS,
  );
  if (!data) return error === undefined ? <Busy /> : <ErrorNote error={error} onRetry={reload} />;
  return (
    <>
      {error !== undefined && <ErrorNote error={error} onRetry={reload} />}
      {trainings.data
        ?.filter(({ state }) => state === "running")
        .map((training) => (
          <RunningTraining key={training.id} training={training} />
        ))}
      {data.models.length === 0 && <NoModel />}
      {data.models.map((model) => (
        <ModelCard
          key={model.name}
          model={model}
          trainings={trainings.data ?? []}
          isOnly={data.models.length === 1}
          reload={reload}
        />
      ))}
    </>
  );
}

interface ModelCardProps {
  model: ModelInfo;
  trainings: Training[];
  isOnly: boolean;
  reload: () => void;
}

function ModelCard({ model, trainings, isOnly, reload }: ModelCardProps) {
  const [isTraining, setTraining] = useState(false);
  const [showsAll, setShowsAll] = useState(false);
  const changer = useChanger(model, reload);
  const blocked = blockedFor("admin");
  const shown = model.versions.filter(
    ({ labels }, index) => showsAll || index < FIRST || labels.length > 0,
  );
  const previous = model.versions.find(({ labels }) => labels.includes("previous"));
  const trainingOf = (version: number) =>
    trainings.find(
      ({ published }) => published?.name === model.name && published.version === version,
    );
  return (
    <section class="card padded">
      <div class="card-head">
        <h2 class="clip">{model.name}</h2>
        {model.default && (
          <Badge kind="accent" title={text.defaultHint}>
            {text.default}
          </Badge>
        )}
        {model.serving == null && <span class="muted">{text.nothingServes}</span>}
        <span class="grow" />
        {!model.default && !isOnly && (
          <Button compact blocked={blocked} onClick={changer.makeDefault}>
            {text.makeDefault}
          </Button>
        )}
        <Button
          compact
          icon="undo"
          blocked={blocked}
          disabled={previous === undefined}
          onClick={changer.rollBack}
        >
          {previous ? text.rollBackTo(previous.version) : text.rollBack}
        </Button>
        <Button compact blocked={blockedForData("admin")} onClick={() => setTraining(true)}>
          {text.train}
        </Button>
      </div>
      <ul class="versions">
        {shown.map((version) => (
          <VersionRow
            key={version.version}
            model={model}
            version={version}
            training={trainingOf(version.version)}
            changer={changer}
          />
        ))}
      </ul>
      {shown.length < model.versions.length && (
        <Button compact kind="plain" onClick={() => setShowsAll(true)}>
          {text.olderVersions(model.versions.length - shown.length)}
        </Button>
      )}
      {isTraining && <ChooseSet model={model.name} onClose={() => setTraining(false)} />}
    </section>
  );
}

/** Asks for the data set first, then for the rest. */
function ChooseSet({ model, onClose }: { model: string; onClose: () => void }) {
  const [chosen, setChosen] = useState<string | undefined>(undefined);
  const [isChosen, setIsChosen] = useState(false);
  const { data, error } = useLoad(listSets, []);
  const names = data?.sets.map(({ name }) => name) ?? [];
  const set = chosen ?? names[0];
  if (isChosen && set !== undefined) {
    return <TrainDialog set={set} model={model} onClose={onClose} />;
  }
  return (
    <Dialog title={text.trainTitle(model)} onClose={onClose}>
      {error !== undefined && <ErrorNote error={error} />}
      <SelectField
        label={text.trainOn}
        value={set ?? ""}
        options={names.map((name) => ({ value: name, label: name }))}
        onChange={setChosen}
      />
      <div class="dialog-foot">
        <Button onClick={onClose}>{common.cancel}</Button>
        <Button kind="primary" disabled={set === undefined} onClick={() => setIsChosen(true)}>
          {text.trainNext}
        </Button>
      </div>
    </Dialog>
  );
}
