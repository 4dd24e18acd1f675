import { getRule } from "../../api/inbox";
import { Button } from "../../components/button";
import { ErrorNote, Note, PageHead } from "../../components/layout";
import { Tabs } from "../../components/tabs";
import { useLoad } from "../../hooks";
import { go, href, route } from "../../route";
import { text } from "../../texts/inbox";
import { FramesView } from "./frames-view";
import "./inbox.css";
import { PolicyForm } from "./policy-form";
import { RuleForm } from "./rule-form";

const TABS = ["frames", "rule", "policy"] as const;

export default function InboxPage() {
  const rule = useLoad(getRule, [], 30_000);
  const [part] = route.value.rest;
  const tab = TABS.find((one) => one === part) ?? "frames";
  const choose = (id: string) => go(href("inbox", id), true);
  const { data } = rule;
  const isOff = data && !data.all && data.robots.length === 0 && data.keys.length === 0;
  return (
    <>
      <PageHead title={text.title} lead={text.lead} />
      {rule.error !== undefined && <ErrorNote error={rule.error} onRetry={rule.reload} />}
      <Tabs
        label={text.tabsLabel}
        tabs={TABS.map((id) => ({ id, label: text.tabs[id] }))}
        chosen={tab}
        onChoose={choose}
      >
        <div class="tab-body stack">
          {isOff && tab === "frames" && (
            <Note>
              <p>{text.off}</p>
              <Button compact icon="settings" onClick={() => choose("rule")}>
                {text.switchOn}
              </Button>
            </Note>
          )}
          {tab === "frames" && <FramesView />}
          {tab === "rule" && data && <RuleForm rule={data} onSaved={rule.set} />}
          {tab === "policy" && <PolicyForm />}
        </div>
      </Tabs>
    </>
  );
}
