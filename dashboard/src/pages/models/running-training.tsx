import type { Training } from "../../api/trainings";
import { Progress } from "../../components/bars";
import { text } from "../../texts/models";
import { trainingHref } from "./paths";

/** A training that is under way, in a line. */
export function RunningTraining({ training }: { training: Training }) {
  const { id, model, set, step, progress } = training;
  return (
    <div class="card padded running">
      <p>
        <a href={trainingHref(id)}>
          <strong>{text.training(id)}</strong>
        </a>{" "}
        {text.trainingOn(model, set)} <span class="muted">{step ?? text.starting}</span>
      </p>
      <Progress label={text.training(id)} value={progress} />
    </div>
  );
}
