import { useEffect, useState } from "preact/hooks";
import { CompactSelect } from "../../components/fields";
import { Badge, Busy, EmptyState, ErrorNote, PageHead } from "../../components/layout";
import { NoModel, useNoModel } from "../../components/no-model";
import { Spoken } from "../../components/spoken";
import { Tabs } from "../../components/tabs";
import { useLoad } from "../../hooks";
import { mapOf } from "../../model-map";
import { href, type PageProps } from "../../route";
import { signIns } from "../../session";
import { text } from "../../texts/live";
import { LiveMap } from "./live-map";
import "./live.css";
import type { Choice } from "./order";
import { RobotDetail } from "./robot-detail";
import { RobotsGrid } from "./robots-grid";
import { RoomsGraph } from "./rooms-graph";
import { changes, entries, feedState, follow, lostEvents } from "./store";

type View = "robots" | "rooms" | "map";

const VIEWS: { id: View; label: string }[] = [
  { id: "robots", label: text.robots },
  { id: "rooms", label: text.rooms },
  { id: "map", label: text.map },
];

const ALL: Choice = { search: "", state: "all" };

export default function LivePage({ rest }: PageProps) {
  useEffect(() => follow(), [signIns.value]);
  const [view, setView] = useState<View>("robots");
  const [choice, setChoice] = useState<Choice>(ALL);
  if (rest[0] !== undefined) return <RobotDetail key={rest[0]} id={rest[0]} />;
  const isEmpty = changes.value >= 0 && entries.size === 0;
  return (
    <>
      <PageHead title={text.title}>
        <Counts />
        <span class="grow" />
        <FeedNote />
      </PageHead>
      {isEmpty ? (
        <NoRobots />
      ) : (
        <Tabs label={text.views} tabs={VIEWS} chosen={view} onChoose={setView}>
          {view === "robots" ? (
            <div class="live-panel">
              <ChoiceBar choice={choice} onChoose={setChoice} />
              <RobotsGrid choice={choice} onShowAll={() => setChoice(ALL)} />
            </div>
          ) : (
            <Maps view={view} />
          )}
        </Tabs>
      )}
    </>
  );
}

function ChoiceBar(props: { choice: Choice; onChoose: (choice: Choice) => void }) {
  const { choice, onChoose } = props;
  const states = Object.entries(text.states).map(([value, label]) => ({ value, label }));
  return (
    <div class="row">
      <input
        class="input compact live-search"
        type="search"
        aria-label={text.search}
        placeholder={text.search}
        value={choice.search}
        onInput={(event) => onChoose({ ...choice, search: event.currentTarget.value })}
      />
      <CompactSelect
        label={text.state}
        value={choice.state}
        options={states}
        onChange={(state) => onChoose({ ...choice, state: state as Choice["state"] })}
      />
    </div>
  );
}

/** How many there are; how many of them are lost is also told aloud. */
function Counts() {
  if (changes.value === 0 || entries.size === 0) return null;
  const robots = [...entries.values()].map(({ robot }) => robot.peek());
  const lost = robots.filter((robot) => robot.connected && robot.lost).length;
  const left = robots.filter((robot) => !robot.connected).length;
  return (
    <>
      <p class={lost > 0 ? "counts some-lost" : "counts muted"}>
        {text.counts(robots.length, lost, left)}
      </p>
      <Spoken text={lost > 0 ? text.lostNow(lost) : ""} />
    </>
  );
}

function FeedNote() {
  const state = feedState.value;
  const kind = state === "broken" ? "bad" : state === "connecting" ? undefined : "good";
  return (
    <span class="row" role="status">
      {lostEvents.value > 0 && (
        <Badge kind="warn" title={text.missedMore}>
          {text.missed(lostEvents.value)}
        </Badge>
      )}
      <Badge kind={kind}>{text.feed[state]}</Badge>
    </span>
  );
}

function NoRobots() {
  const hasNoModel = useNoModel();
  if (hasNoModel) return <NoModel />;
  if (feedState.value === "connecting") return <Busy />;
  const url = new URL("v1/recognize?robot=wall-e", document.baseURI);
  url.hash = "";
  return (
    <EmptyState icon="robot" title={text.none} text={text.noneMore}>
      <a class="button primary" href={href("try")}>
        {text.openTry}
      </a>
      <p>{text.noneExample}</p>
      <code class="example">curl --data-binary @frame.jpg &apos;{url.href}&apos;</code>
    </EmptyState>
  );
}

/** The models that robots are answered by, the one of most robots first. */
function modelsInUse(): { name: string; version: number; key: string }[] {
  const counts = new Map<string, { name: string; version: number; n: number }>();
  for (const { robot } of entries.values()) {
    const { model } = robot.peek();
    if (!model) continue;
    const key = `${model.name}/${model.version}`;
    counts.set(key, { ...model, n: (counts.get(key)?.n ?? 0) + 1 });
  }
  return [...counts]
    .sort(([, one], [, other]) => other.n - one.n)
    .map(([key, { name, version }]) => ({ name, version, key }));
}

function Maps({ view }: { view: "rooms" | "map" }) {
  const [chosen, setChosen] = useState<string>();
  const models = changes.value >= 0 ? modelsInUse() : [];
  const model = models.find(({ key }) => key === chosen) ?? models[0];
  const map = useLoad(() => (model ? mapOf(model) : Promise.resolve(undefined)), [model?.key]);
  return (
    <div class="live-panel">
      {models.length > 1 && model && (
        <div class="row">
          <CompactSelect
            label={text.model}
            value={model.key}
            options={models.map(({ key }) => ({ value: key, label: key }))}
            onChange={setChosen}
          />
        </div>
      )}
      <div class="card padded">
        {map.error !== undefined && <ErrorNote error={map.error} onRetry={map.reload} />}
        {map.data ? (
          view === "rooms" ? (
            <RoomsGraph map={map.data} />
          ) : (
            <LiveMap positions={map.data.positions} />
          )
        ) : map.loading ? (
          <Busy />
        ) : (
          map.error === undefined && (
            <EmptyState icon="models" title={text.noGraph} text={text.noGraphMore} />
          )
        )}
      </div>
    </div>
  );
}
