import { listModels } from "../api/models";
import { useLoad } from "../hooks";
import { href } from "../route";
import { text } from "../texts/models";
import { EmptyState } from "./layout";

const EVERY_MS = 4000;

/** Whether there is no model, so that nothing can be answered; false until it is known. */
export function useNoModel(): boolean {
  const { data } = useLoad(listModels, [], EVERY_MS);
  return data?.models.length === 0;
}

/** Where nothing can be answered yet: the way to a first model. */
export function NoModel() {
  return (
    <EmptyState icon="models" title={text.none} text={text.noneText}>
      <a class="button primary" href={href("teach")}>
        {text.toTeach}
      </a>
    </EmptyState>
  );
}
