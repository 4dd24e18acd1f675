import {
  getTraining,
  listTrainings,
  type Card,
  type Report,
  type Training,
} from "../../api/trainings";
import { getVersion } from "../../api/versions";
import { text } from "../../texts/models";
import type { Subject } from "./paths";

/** A version or a training with all that is known of how it was trained. */
export interface Described {
  label: string;
  card?: Card;
  report?: Report;
  training?: Training;
}

/** The training that made a version, where one of this service did. */
export async function trainingOf(
  model: string,
  version: number,
  signal?: AbortSignal,
): Promise<Training | undefined> {
  try {
    const all = await listTrainings(signal);
    const made = all.find(
      ({ published }) => published?.name === model && published.version === version,
    );
    return made && (await getTraining(made.id, signal));
  } catch (error) {
    // Without a data directory there are no trainings, and a version has its card alone.
    if (signal?.aborted) throw error;
    return undefined;
  }
}

export async function describe(subject: Subject, signal?: AbortSignal): Promise<Described> {
  if (subject.kind === "training") {
    const training = await getTraining(subject.id, signal);
    const { report } = training;
    return {
      label: text.subjectTraining(training.id, training.set),
      card: report?.card,
      report,
      training,
    };
  }
  const { model, version } = subject;
  const [details, training] = await Promise.all([
    getVersion(model, version, signal),
    trainingOf(model, version, signal),
  ]);
  return {
    label: `${model}/${version}`,
    card: details.card ?? training?.report?.card,
    report: training?.report,
    training,
  };
}
