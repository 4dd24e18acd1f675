import { listTrainings, type Training } from "../../api/trainings";
import { Badge, Busy, EmptyState, ErrorNote } from "../../components/layout";
import { dateTime, duration, percent } from "../../format";
import { useLoad } from "../../hooks";
import { href } from "../../route";
import { text } from "../../texts/models";
import { trainingHref } from "./paths";
import { RunningTraining } from "./running-training";

const EVERY_MS = 3000;

export const STATE_KINDS = {
  running: "accent",
  done: "good",
  failed: "bad",
  cancelled: undefined,
} as const;

/** How long a training took, in seconds. */
export function secondsOf({ began_at: began, ended_at: ended }: Training): number {
  return (new Date(ended ?? Date.now()).getTime() - new Date(began).getTime()) / 1000;
}

/** All trainings, the last first. */
export function TrainingList() {
  const { data, error, reload } = useLoad(listTrainings, [], EVERY_MS);
  if (!data) return error === undefined ? <Busy /> : <ErrorNote error={error} onRetry={reload} />;
  if (data.length === 0) {
    return <EmptyState icon="models" title={text.noTrainings} text={text.noTrainingsText} />;
  }
  return (
    <>
      {error !== undefined && <ErrorNote error={error} onRetry={reload} />}
      <ul class="trainings">
        {data.map((training) =>
          training.state === "running" ? (
            <li key={training.id}>
              <RunningTraining training={training} />
            </li>
          ) : (
            <li key={training.id} class="card padded training">
              <p>
                <a href={trainingHref(training.id)}>
                  <strong>{text.training(training.id)}</strong>
                </a>{" "}
                {text.trainingOn(training.model, training.set)}
              </p>
              <p class="row">
                <Badge kind={STATE_KINDS[training.state]}>
                  {text.trainingStates[training.state]}
                </Badge>
                {training.rate !== undefined && (
                  <span class="number">{text.heldOut(percent(training.rate))}</span>
                )}
                {training.published && (
                  <a href={href("models", training.published.name, training.published.version)}>
                    {text.published(training.published.name, training.published.version)}
                  </a>
                )}
                {training.error !== undefined && <span class="failure">{training.error}</span>}
              </p>
              <p class="muted small">
                {text.began(dateTime(training.began_at), training.by)},{" "}
                {text.took(duration(secondsOf(training)))}
              </p>
            </li>
          ),
        )}
      </ul>
    </>
  );
}
