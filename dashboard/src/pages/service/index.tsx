import { Audit } from "../../components/audit-list";
import { PageHead } from "../../components/layout";
import { Tabs } from "../../components/tabs";
import { go, href, type PageProps } from "../../route";
import { text as auditText } from "../../texts/audit";
import { text } from "../../texts/service";
import { About } from "./about";
import { Keys } from "./keys";
import { Overview } from "./overview";
import "./service.css";

const SECTIONS = {
  overview: { label: text.overview, component: Overview },
  keys: { label: text.keys, component: Keys },
  audit: { label: auditText.title, component: Audit },
  about: { label: text.about, component: About },
};

type Section = keyof typeof SECTIONS;

const isSection = (name: string | undefined): name is Section =>
  name !== undefined && Object.hasOwn(SECTIONS, name);

export default function ServicePage({ rest }: PageProps) {
  const chosen = isSection(rest[0]) ? rest[0] : "overview";
  const Component = SECTIONS[chosen].component;
  const tabs = Object.entries(SECTIONS).map(([id, { label }]) => ({ id: id as Section, label }));
  return (
    <>
      <PageHead title={text.title} />
      <Tabs
        label={text.sections}
        tabs={tabs}
        chosen={chosen}
        onChoose={(id) => go(href("service", id), true)}
      >
        <div class="service-panel">
          <Component />
        </div>
      </Tabs>
    </>
  );
}
