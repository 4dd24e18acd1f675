import { useState } from "preact/hooks";
import { putRule, type Rule, type RuleSettings } from "../../api/inbox";
import { Button } from "../../components/button";
import { TextField } from "../../components/fields";
import { ErrorNote } from "../../components/layout";
import { toast } from "../../components/toast";
import { bytes } from "../../format";
import { useAction } from "../../hooks";
import { blockedForData } from "../../session";
import { text } from "../../texts/inbox";
import { Radios } from "../../components/radios";

const MIB = 2 ** 20;
type Who = "off" | "all" | "some";

interface Draft {
  who: Who;
  robots: string;
  keys: string;
  every: string;
  probability: string;
  frames: string;
  mebibytes: string;
  days: string;
}

function draftOf(rule: Rule): Draft {
  const hasNames = rule.robots.length + rule.keys.length > 0;
  return {
    who: rule.all ? "all" : hasNames ? "some" : "off",
    robots: rule.robots.join(", "),
    keys: rule.keys.join(", "),
    every: String(rule.every_s),
    probability: String(Math.round(rule.probability * 100)),
    frames: String(rule.max_frames),
    mebibytes: String(Math.round(rule.max_bytes / MIB)),
    days: String(rule.max_days),
  };
}

const names = (list: string) =>
  list
    .split(",")
    .map((name) => name.trim())
    .filter(Boolean);

function settingsOf(draft: Draft): RuleSettings {
  const isSome = draft.who === "some";
  return {
    all: draft.who === "all",
    robots: isSome ? names(draft.robots) : [],
    keys: isSome ? names(draft.keys) : [],
    every_s: Number(draft.every),
    probability: Number(draft.probability) / 100,
    max_frames: Number(draft.frames),
    max_bytes: Number(draft.mebibytes) * MIB,
    max_days: Number(draft.days),
  };
}

/** Which frames are kept, of whom and for how long. */
export function RuleForm({ rule, onSaved }: { rule: Rule; onSaved: (rule: Rule) => void }) {
  const [draft, setDraft] = useState(() => draftOf(rule));
  const [isTold, setTold] = useState(false);
  const { run, busy, error } = useAction(async () => {
    const saved = await putRule(settingsOf(draft));
    setDraft(draftOf(saved));
    onSaved(saved);
    toast({ text: text.saved });
  });
  const set = (change: Partial<Draft>) => setDraft({ ...draft, ...change });
  const isNobody = draft.who === "some" && names(`${draft.robots},${draft.keys}`).length === 0;
  const submit = (event: Event) => {
    event.preventDefault();
    setTold(true);
    if (!isNobody) void run();
  };
  return (
    <form class="card padded stack form" onSubmit={submit}>
      <p>{text.ruleLead}</p>
      <p class="muted">{text.ruleHolds(rule.frames, bytes(rule.bytes))}</p>
      <Radios
        legend={text.ruleWho}
        value={draft.who}
        options={[
          { value: "off", label: text.ruleOff },
          { value: "all", label: text.ruleAll },
          { value: "some", label: text.ruleSome },
        ]}
        onChange={(who) => set({ who })}
      />
      {draft.who === "some" && (
        <div class="fields">
          <TextField
            label={text.ruleRobots}
            hint={text.ruleRobotsHint}
            wrong={isTold && isNobody ? text.ruleNeedsSome : undefined}
            value={draft.robots}
            onInput={(robots) => set({ robots })}
          />
          <TextField
            label={text.ruleKeys}
            hint={text.ruleKeysHint}
            value={draft.keys}
            onInput={(keys) => set({ keys })}
          />
        </div>
      )}
      <div class="fields">
        <TextField
          type="number"
          label={text.ruleEvery}
          min={0}
          step="any"
          required
          value={draft.every}
          onInput={(every) => set({ every })}
        />
        <TextField
          type="number"
          label={text.ruleProbability}
          min={0}
          max={100}
          required
          value={draft.probability}
          onInput={(probability) => set({ probability })}
        />
        <TextField
          type="number"
          label={text.ruleFrames}
          min={1}
          required
          value={draft.frames}
          onInput={(frames) => set({ frames })}
        />
        <TextField
          type="number"
          label={text.ruleBytes}
          min={1}
          required
          value={draft.mebibytes}
          onInput={(mebibytes) => set({ mebibytes })}
        />
        <TextField
          type="number"
          label={text.ruleDays}
          min={1}
          required
          value={draft.days}
          onInput={(days) => set({ days })}
        />
      </div>
      <p class="muted small">{text.ruleDrops}</p>
      {error !== undefined && <ErrorNote error={error} />}
      <div class="row">
        <Button kind="primary" type="submit" busy={busy} blocked={blockedForData("admin")}>
          {text.save}
        </Button>
      </div>
    </form>
  );
}
