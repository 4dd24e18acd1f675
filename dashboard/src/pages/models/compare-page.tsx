import { listModels } from "../../api/models";
import { listTrainings, type Training } from "../../api/trainings";
import { BackLink } from "../../components/back-link";
import { SelectField } from "../../components/fields";
import { Busy, ErrorNote, PageHead } from "../../components/layout";
import { useLoad } from "../../hooks";
import { go, href } from "../../route";
import { text } from "../../texts/models";
import { COMPARE, parsed, written, type Subject } from "./paths";
import { ReportView } from "./report-view";
import { describe } from "./subject";

interface Choosable {
  subject: Subject;
  label: string;
}

/** All versions, and trainings that nobody has published. */
async function choosable(signal: AbortSignal): Promise<Choosable[]> {
  const [{ models }, trainings] = await Promise.all([
    listModels(signal),
    listTrainings(signal).catch(() => [] as Training[]),
  ]);
  const versions = models.flatMap(({ name, versions }) =>
    versions.map(({ version }): Choosable => ({
      subject: { kind: "version", model: name, version },
      label: `${name}/${version}`,
    })),
  );
  const open = trainings.filter(({ state, published }) => state === "done" && !published);
  const others = open.map(({ id, set }): Choosable => ({
    subject: { kind: "training", id },
    label: text.subjectTraining(id, set),
  }));
  return [...versions, ...others];
}

/** Two versions, or a version and a training, side by side. */
export function ComparePage({ left, right }: { left?: string; right?: string }) {
  const choices = useLoad(choosable, []);
  const options = (choices.data ?? []).map(({ subject, label }) => ({
    value: written(subject),
    label,
  }));
  const both = useLoad(
    async (signal) => {
      const subjects = [parsed(left), parsed(right)].filter((subject) => subject !== undefined);
      return await Promise.all(subjects.map((subject) => describe(subject, signal)));
    },
    [left, right],
  );
  const choose = (first: string | undefined, second: string | undefined) =>
    go(href("models", COMPARE, first ?? "-", second ?? "-"), true);
  return (
    <>
      <PageHead title={text.compareTitle}>
        <BackLink href={href("models")} label={text.back} />
      </PageHead>
      <div class="stack">
        <div class="fields form">
          <SelectField
            label={text.first}
            value={left ?? ""}
            options={options}
            onChange={(value) => choose(value, right)}
          />
          <SelectField
            label={text.second}
            value={right ?? ""}
            options={options}
            onChange={(value) => choose(left, value)}
          />
        </div>
        {both.error !== undefined && <ErrorNote error={both.error} onRetry={both.reload} />}
        {both.loading && !both.data && <Busy />}
        {both.data && <ReportView described={both.data} />}
      </div>
    </>
  );
}
