import { address } from "../../api/client";
import { SelectField } from "../../components/fields";
import { dateTime, duration } from "../../format";
import { service } from "../../session";
import { text as common } from "../../texts/common";
import { text } from "../../texts/service";
import { type Theme, theme, THEMES } from "../../theme";

const THEME_LABELS: Record<Theme, string> = {
  system: common.themeSystem,
  light: common.themeLight,
  dark: common.themeDark,
};

const LINKS = [
  { path: "docs/", label: text.link.docs },
  { path: "openapi.json", label: text.link.openapi },
  { path: "asyncapi.json", label: text.link.asyncapi },
  { path: "metrics", label: text.link.metrics },
];

/** What the service is set to, where programs find it, and how this page looks. */
export function About() {
  const info = service.value;
  const told = (yes: boolean) => (yes ? text.yes : text.no);
  const rows: [string, string | undefined][] = info
    ? [
        [text.version, info.version],
        [text.started, dateTime(info.started_at)],
        [text.modelsFolder, info.models_folder],
        [text.dataKept, told(info.data)],
        [text.keysAsked, told(info.keys)],
        [text.framesKept, told(info.frames_kept)],
        [text.lostAfter, text.unknownFor(duration(info.lost_after_s))],
        [text.webhooks, String(info.webhooks)],
        [text.mqtt, told(info.mqtt)],
      ]
    : [];
  return (
    <div class="about">
      <section class="card padded stack">
        <h2>{text.aboutService}</h2>
        <dl class="numbers">
          {rows.map(
            ([name, value]) =>
              value && [<dt key={`${name}-name`}>{name}</dt>, <dd key={name}>{value}</dd>],
          )}
        </dl>
      </section>
      <section class="card padded stack">
        <h2>{text.links}</h2>
        <ul class="links">
          {LINKS.map(({ path, label }) => (
            <li key={path}>
              <a href={address(path)}>{label}</a>
            </li>
          ))}
        </ul>
      </section>
      <section class="card padded stack">
        <h2>{common.theme}</h2>
        <SelectField
          label={common.theme}
          value={theme.value}
          options={THEMES.map((value) => ({ value, label: THEME_LABELS[value] }))}
          onChange={(value) => {
            theme.value = value as Theme;
          }}
        />
      </section>
    </div>
  );
}
