import type { ModelInfo } from "../../api/models";
import { getModel, getVersion, type VersionDetails } from "../../api/versions";
import { BackLink } from "../../components/back-link";
import { Busy, ErrorNote, Note, PageHead } from "../../components/layout";
import { dateTime } from "../../format";
import { useLoad } from "../../hooks";
import { href } from "../../route";
import { text } from "../../texts/models";
import { useChanger } from "./changer";
import { compareHref } from "./paths";
import { ReportView } from "./report-view";
import { ShadowLine } from "./shadow-line";
import { trainingOf } from "./subject";
import { VerdictView } from "./verdict-view";
import { Labels, Steps } from "./version-row";

const EVERY_MS = 5000;

/** One version: its card, its states, and the next step for it. */
export function VersionPage({ model: name, version }: { model: string; version: number }) {
  const { data, error, reload } = useLoad(
    async (signal) => {
      const [model, details] = await Promise.all([
        getModel(name, signal),
        getVersion(name, version, signal),
      ]);
      return { model, details };
    },
    [name, version],
    EVERY_MS,
  );
  return (
    <>
      <PageHead title={`${name}/${version}`}>
        <BackLink href={href("models")} label={text.back} />
        {data && <Labels version={data.details} />}
      </PageHead>
      {error !== undefined && <ErrorNote error={error} onRetry={reload} />}
      {!data && error === undefined && <Busy />}
      {data && <Version model={data.model} details={data.details} reload={reload} />}
    </>
  );
}

interface VersionProps {
  model: ModelInfo;
  details: VersionDetails;
  reload: () => void;
}

function Version({ model, details, reload }: VersionProps) {
  const { name, serving } = model;
  const { version, failure, shadow, card } = details;
  const changer = useChanger(model, reload);
  const training = useLoad((signal) => trainingOf(name, version, signal), [name, version]);
  const report = training.data?.report;
  return (
    <div class="stack">
      {failure && (
        <Note kind="bad">
          <p>{text.failedAt(failure.stage, failure.reason)}</p>
        </Note>
      )}
      <div class="row">
        <Steps version={details} hasStable={serving != null} changer={changer} />
        {serving != null && serving !== version && (
          <a
            class="button compact"
            href={compareHref(
              { kind: "version", model: name, version: serving },
              { kind: "version", model: name, version },
            )}
          >
            {text.compareStable}
          </a>
        )}
      </div>
      {shadow && (
        <section class="card padded">
          <ShadowLine shadow={shadow} />
        </section>
      )}
      {report && (
        <section class="card padded">
          <h2>{text.verdict}</h2>
          <VerdictView report={report} />
        </section>
      )}
      <ReportView
        described={[
          { label: `${name}/${version}`, card: card ?? undefined, report, training: training.data },
        ]}
      />
      <section class="card padded">
        <h2>{text.history}</h2>
        <dl class="facts">
          {details.history.map(({ state, at }) => (
            <div key={`${at} ${state}`}>
              <dt>{dateTime(at)}</dt>
              <dd>{text.states[state]}</dd>
            </div>
          ))}
          {details.digest && (
            <div>
              <dt>{text.digest}</dt>
              <dd class="wrap">
                <code>{details.digest}</code>
              </dd>
            </div>
          )}
        </dl>
      </section>
    </div>
  );
}
