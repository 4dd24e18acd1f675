import { useMemo } from "preact/hooks";
import { listRobots } from "../../api/live";
import { listModels, type ModelInfo, type VersionInfo } from "../../api/models";
import { getHistory, type History, type ServiceInfo } from "../../api/service";
import { Badge, Busy, EmptyState, ErrorNote } from "../../components/layout";
import { lazy } from "../../components/lazy";
import { bytes, count, dateTime, decimal, duration, milliseconds } from "../../format";
import { useLoad } from "../../hooks";
import { href } from "../../route";
import { service } from "../../session";
import { text as common } from "../../texts/common";
import { text } from "../../texts/service";
import { type ChartData, chartsOf } from "./series";
import { Table } from "../../components/table";

const Chart = lazy<{ data: ChartData }>(() => import("./chart"));

const OFTEN_MS = 5000;
const HISTORY_MS = 10_000;
const MOST_CONNECTED = 30;

/** How the service does, now and in the last hour. */
export function Overview() {
  const history = useLoad(getHistory, [], HISTORY_MS);
  const charts = useMemo(() => (history.data ? chartsOf(history.data) : []), [history.data]);
  return (
    <div class="stack">
      {history.error !== undefined && <ErrorNote error={history.error} onRetry={history.reload} />}
      {history.data ? (
        <>
          <Tiles history={history.data} info={service.value} />
          <section class="stack" aria-label={text.lastHour}>
            <h2>{text.lastHour}</h2>
            {history.data.points.length === 0 ? (
              <EmptyState icon="service" title={text.noHistory} text={text.noHistoryMore} />
            ) : (
              <div class="charts">
                {charts.map((chart) => (
                  <Chart key={chart.id} data={chart} />
                ))}
              </div>
            )}
          </section>
        </>
      ) : (
        history.loading && <Busy />
      )}
      <div class="service-tables">
        <Models />
        <Connected />
      </div>
    </div>
  );
}

function Tiles({ history, info }: { history: History; info: ServiceInfo | undefined }) {
  const { interval_s, points } = history;
  const last = points.at(-1);
  const { nothing } = common;
  const uptime = info ? (Date.now() - Date.parse(info.started_at)) / 1000 : undefined;
  const tiles: [string, string, string | undefined][] = [
    [text.uptime, duration(uptime), info && text.sinceStart(dateTime(info.started_at))],
    [
      text.answersNow,
      last ? text.perSecond(decimal(last.answers / interval_s)) : nothing,
      last && text.cores(decimal(last.cpu_s / interval_s, 2)),
    ],
    [
      text.latencyNow,
      milliseconds(last?.p50_ms),
      last && text.halfAnd99(milliseconds(last.p99_ms)),
    ],
    [
      text.queueNow,
      count(last?.queue),
      last && info && text.busyOf(decimal(last.busy), info.threads),
    ],
    [text.memoryNow, bytes(last?.memory_bytes), undefined],
    [text.robotsNow, count(last?.robots), last && text.lostAndStreams(last.lost, last.streams)],
  ];
  return (
    <dl class="tiles">
      {tiles.map(([name, value, more]) => (
        <div key={name} class="card tile">
          <dt class="muted small">{name}</dt>
          <dd class="tile-value number">{value}</dd>
          {more && <dd class="muted small">{more}</dd>}
        </div>
      ))}
    </dl>
  );
}

function stateKind({ state }: VersionInfo) {
  if (state === "failed") return "bad";
  if (state === "ready") return "good";
  return state === "unloaded" || state === "discovered" ? undefined : "accent";
}

function Models() {
  const models = useLoad(listModels, [], OFTEN_MS);
  const rows = (models.data?.models ?? []).flatMap((model) =>
    model.versions.map((version) => ({ model, version })),
  );
  return (
    <section class="card padded" aria-label={text.models}>
      <div class="card-head">
        <h2>{text.models}</h2>
      </div>
      {models.error !== undefined && <ErrorNote error={models.error} onRetry={models.reload} />}
      {models.data && rows.length === 0 && (
        <EmptyState icon="models" title={text.modelsNone} text={text.modelsNoneMore} />
      )}
      {rows.length > 0 && (
        <Table
          label={text.models}
          head={[text.model, text.state, text.servesAs, text.since]}
          rows={rows.map(({ model, version }) => modelRow(model, version))}
        />
      )}
    </section>
  );
}

function modelRow(model: ModelInfo, version: VersionInfo) {
  const { failure, labels, history } = version;
  const cells = [
    <a href={href("models", model.name, version.version)}>
      {model.name}/{version.version}
    </a>,
    <>
      <Badge kind={stateKind(version)}>{text.states[version.state]}</Badge>
      {failure && <p class="small">{text.failed(failure.stage, failure.reason)}</p>}
    </>,
    labels.join(", ") || common.nothing,
    dateTime(history.at(-1)?.at),
  ];
  return { key: `${model.name}/${version.version}`, cells };
}

function Connected() {
  const robots = useLoad(listRobots, [], OFTEN_MS);
  const there = (robots.data ?? []).filter(({ connected }) => connected);
  return (
    <section class="card padded" aria-label={text.connected}>
      <div class="card-head">
        <h2 class="grow">{text.connected}</h2>
        {there.length > MOST_CONNECTED && (
          <a href={href("live")}>{text.connectedMore(there.length - MOST_CONNECTED)}</a>
        )}
      </div>
      {robots.error !== undefined && <ErrorNote error={robots.error} onRetry={robots.reload} />}
      {robots.data && there.length === 0 && <p class="muted">{text.connectedNone}</p>}
      {there.length > 0 && (
        <Table
          label={text.connected}
          head={[text.robot, text.via, text.key, text.rate, text.latency]}
          numbers={[3, 4]}
          rows={there.slice(0, MOST_CONNECTED).map((robot) => ({
            key: robot.id,
            cells: [
              <a href={href("live", robot.id)}>{robot.id}</a>,
              robot.via === "rest" ? text.viaRest : text.viaStream,
              robot.key ?? text.noKey,
              decimal(robot.frames_per_s),
              milliseconds(robot.latency_ms),
            ],
          }))}
        />
      )}
    </section>
  );
}
