import { Audit } from "../../components/audit-list";
import { PageHead } from "../../components/layout";
import { Tabs } from "../../components/tabs";
import { go, href, route } from "../../route";
import { text } from "../../texts/models";
import { ComparePage } from "./compare-page";
import "./models.css";
import { ModelList } from "./model-list";
import { AUDIT, COMPARE, TRAININGS } from "./paths";
import { TrainingList } from "./training-list";
import { TrainingPage } from "./training-page";
import { VersionPage } from "./version-page";

const TABS = ["models", "trainings", "audit"] as const;
type Tab = (typeof TABS)[number];

const PATHS: Record<Tab, string[]> = { models: [], trainings: [TRAININGS], audit: [AUDIT] };

export default function ModelsPage() {
  const [first, second, third] = route.value.rest;
  if (first === COMPARE) return <ComparePage left={second} right={third} />;
  if (first === TRAININGS && second !== undefined) {
    return <TrainingPage key={second} id={Number(second)} />;
  }
  if (first !== undefined && second !== undefined) {
    return <VersionPage key={`${first} ${second}`} model={first} version={Number(second)} />;
  }
  const tab: Tab = first === TRAININGS ? "trainings" : first === AUDIT ? "audit" : "models";
  return (
    <>
      <PageHead title={text.title} />
      <Tabs
        label={text.tabsLabel}
        tabs={TABS.map((id) => ({ id, label: text.tabs[id] }))}
        chosen={tab}
        onChoose={(id) => go(href("models", ...PATHS[id]), true)}
      >
        <div class="tab-body stack">
          {tab === "models" && <ModelList />}
          {tab === "trainings" && <TrainingList />}
          {tab === "audit" && <Audit />}
        </div>
      </Tabs>
    </>
  );
}
