import { useState } from "preact/hooks";
import { ApiError } from "../../api/client";
import { cancelTraining, getTraining, publishTraining, type Training } from "../../api/trainings";
import { activate, getModel, putLabel } from "../../api/versions";
import { BackLink } from "../../components/back-link";
import { Progress } from "../../components/bars";
import { Button } from "../../components/button";
import { confirm } from "../../components/dialog";
import { Badge, Busy, ErrorNote, Note, PageHead } from "../../components/layout";
import { toast } from "../../components/toast";
import { dateTime, duration } from "../../format";
import { useAction, useLoad } from "../../hooks";
import { go, href } from "../../route";
import { blockedForData } from "../../session";
import { text } from "../../texts/models";
import { ComparisonView } from "./comparison-view";
import { compareHref, TRAININGS } from "./paths";
import { ReportView } from "./report-view";
import { secondsOf, STATE_KINDS } from "./training-list";
import { VerdictView } from "./verdict-view";

const EVERY_MS = 1500;
/** What lines of the log begin with that say something to know. */
const NOTE = "note: ";

/** One training: how far it is, what it says, and what to do with what it made. */
export function TrainingPage({ id }: { id: number }) {
  const [isRunning, setRunning] = useState(true);
  const { data, error, reload } = useLoad(
    async (signal) => {
      const training = await getTraining(id, signal);
      setRunning(training.state === "running");
      return training;
    },
    [id],
    isRunning ? EVERY_MS : undefined,
  );
  return (
    <>
      <PageHead title={text.training(id)}>
        <BackLink href={href("models", TRAININGS)} label={text.backToTrainings} />
        {data && <Badge kind={STATE_KINDS[data.state]}>{text.trainingStates[data.state]}</Badge>}
      </PageHead>
      {error !== undefined && <ErrorNote error={error} onRetry={reload} />}
      {!data && error === undefined && <Busy />}
      {data && (
        <div class="stack">
          <Head training={data} reload={reload} />
          {data.state === "failed" && (
            <Note kind="bad">
              <p>{data.error}</p>
            </Note>
          )}
          {data.state === "done" && <Outcome training={data} reload={reload} />}
          {data.log && data.log.length > 0 && (
            <details class="card padded log" open={data.state !== "done"}>
              <summary>
                <h2>{text.log}</h2>
              </summary>
              <pre tabIndex={0}>{data.log.join("\n")}</pre>
            </details>
          )}
          {data.report && (
            <ReportView
              described={[
                {
                  label: text.training(data.id),
                  card: data.report.card,
                  report: data.report,
                  training: data,
                },
              ]}
            />
          )}
        </div>
      )}
    </>
  );
}

interface PartProps {
  training: Training;
  reload: () => void;
}

function Head({ training, reload }: PartProps) {
  const { id, model, set, effort, began_at: began, by } = training;
  const cancel = useAction(async () => {
    const question = {
      title: text.cancelTitle,
      text: text.cancelText,
      action: text.cancelTraining,
      danger: true,
    };
    if (!(await confirm(question))) return;
    await cancelTraining(id);
    reload();
  });
  const isRunning = training.state === "running";
  return (
    <section class="card padded stack">
      <div class="row">
        <p class="grow">
          <strong>{text.trainingOn(model, set)}</strong>{" "}
          <span class="muted">
            {text.efforts[effort]} · {text.began(dateTime(began), by)} ·{" "}
            {(isRunning ? text.runsFor : text.took)(duration(secondsOf(training)))}
          </span>
        </p>
        {isRunning && (
          <Button
            compact
            busy={cancel.busy}
            blocked={blockedForData("admin")}
            onClick={() => void cancel.run()}
          >
            {text.cancelTraining}
          </Button>
        )}
      </div>
      {isRunning && (
        <div role="status" class="stack running">
          <p>{training.step ?? text.starting}</p>
          <Progress label={text.training(id)} value={training.progress} />
        </div>
      )}
      {cancel.error !== undefined && <ErrorNote error={cancel.error} />}
    </section>
  );
}

/** What the log notes, such as that there is no network: few open a log of what went well. */
function notesOf({ log }: Training): string[] {
  return (log ?? []).filter((line) => line.startsWith(NOTE)).map((line) => line.slice(NOTE.length));
}

/** What the training says, and the way of its model into service. */
function Outcome({ training, reload }: PartProps) {
  const { id, comparison, published, report } = training;
  const serving = /^(.+)\/(\d+)$/.exec(comparison?.serving ?? "");
  return (
    <div class="report-grid">
      {report && (
        <section class="card padded">
          <h2>{text.verdict}</h2>
          <VerdictView report={report} />
          {notesOf(training).map((note) => (
            <Note key={note}>
              <p>{note}</p>
            </Note>
          ))}
        </section>
      )}
      <section class="card padded stack">
        {comparison && (
          <>
            <h2>{text.comparison}</h2>
            <ComparisonView comparison={comparison} />
          </>
        )}
        {serving && (
          <a
            class="small"
            href={compareHref(
              { kind: "version", model: serving[1] ?? "", version: Number(serving[2]) },
              { kind: "training", id },
            )}
          >
            {text.compareServing}
          </a>
        )}
        {published ? (
          <p>
            <a href={href("models", published.name, published.version)}>
              {text.published(published.name, published.version)}
            </a>
          </p>
        ) : (
          <Publish training={training} reload={reload} />
        )}
      </section>
    </div>
  );
}

/** Whether any version of a model serves; a model that is not there yet serves none. */
async function serves(model: string, signal: AbortSignal): Promise<boolean> {
  try {
    return (await getModel(model, signal)).serving != null;
  } catch (error) {
    if (error instanceof ApiError && error.status === 404) return false;
    throw error;
  }
}

/** The first step of a model: beside one that serves it is a shadow, the first of its name serves. */
function Publish({ training, reload }: PartProps) {
  const { id, model, comparison } = training;
  const isWorse = comparison?.is_worse ?? false;
  const blocked = blockedForData("admin");
  const { data: hasServing } = useLoad((signal) => serves(model, signal), [model]);
  const { run, busy, error } = useAction(async (goesOn: boolean) => {
    const { name, version } = await publishTraining(id, isWorse);
    const told = `${name}/${version}`;
    if (goesOn) {
      const { epoch } = await getModel(name);
      if (hasServing) await putLabel(name, "shadow", version, epoch);
      else await activate(name, version, epoch);
      toast({ text: hasServing ? text.isShadow(told) : text.isStable(told) });
      go(href("models"));
    } else {
      toast({ text: text.publishedToast(told) });
    }
    reload();
  });
  const hint = hasServing ? text.publishShadowHint : text.publishFirstHint;
  return (
    <>
      <div class="row">
        {!isWorse && hasServing !== undefined && (
          <Button kind="primary" busy={busy} blocked={blocked} onClick={() => void run(true)}>
            {hasServing ? text.publishShadow : text.publishFirst}
          </Button>
        )}
        <Button
          kind={isWorse ? "danger" : undefined}
          busy={busy}
          blocked={blocked}
          onClick={() => void run(false)}
        >
          {isWorse ? text.publishAnyway : text.publish(model)}
        </Button>
      </div>
      <p class="muted small">{isWorse ? text.publishHint : hint}</p>
      {error !== undefined && <ErrorNote error={error} />}
    </>
  );
}
