import { useState } from "preact/hooks";
import type { ModelInfo, VersionInfo } from "../../api/models";
import type { Training } from "../../api/trainings";
import { Button } from "../../components/button";
import { CompactSelect } from "../../components/fields";
import { Badge } from "../../components/layout";
import { dateTime, percent } from "../../format";
import { href } from "../../route";
import { blockedFor } from "../../session";
import { text } from "../../texts/models";
import type { Changer } from "./changer";
import { compareHref } from "./paths";
import { ShadowLine } from "./shadow-line";

const SHARES = [0.05, 0.1, 0.25, 0.5];
const FIRST_SHARE = 0.1;

interface VersionRowProps {
  model: ModelInfo;
  version: VersionInfo;
  training?: Training;
  changer: Changer;
}

/** A version: what it serves as, how good it is, and the next step for it. */
export function VersionRow({ model, version, training, changer }: VersionRowProps) {
  const { name, serving } = model;
  const { version: number, failure, shadow, labels } = version;
  const isStable = labels.includes("stable");
  return (
    <li class={isStable ? "version stable" : "version"}>
      <div class="version-name">
        <a href={href("models", name, number)}>
          <strong>{text.version(number)}</strong>
        </a>
        <Labels version={version} />
      </div>
      <div class="version-about">
        {training?.rate !== undefined && (
          <p class="number">
            {text.heldOut(percent(training.rate))}
            <span class="muted">
              {" "}
              · {training.set} · {dateTime(training.ended_at)}
            </span>
          </p>
        )}
        {failure && <p class="failure">{text.failedAt(failure.stage, failure.reason)}</p>}
        {labels.includes("shadow") && shadow && <ShadowLine shadow={shadow} />}
      </div>
      <div class="version-actions row">
        <Steps version={version} hasStable={serving != null} changer={changer} />
        {serving != null && !isStable && (
          <a
            class="button plain compact"
            href={compareHref(
              { kind: "version", model: name, version: serving },
              { kind: "version", model: name, version: number },
            )}
          >
            {text.compare}
          </a>
        )}
        {labels.length === 0 && (
          <Button
            compact
            kind="plain"
            icon="remove"
            label={`${text.remove} ${number}`}
            blocked={blockedFor("admin")}
            onClick={() => changer.remove(number)}
          />
        )}
      </div>
    </li>
  );
}

/** What a version serves as, and its state where that is not plain. */
export function Labels({ version }: { version: VersionInfo }) {
  const { labels, state } = version;
  const share = percent(version.share);
  return (
    <>
      {labels.includes("stable") && (
        <Badge kind="good" title={text.stableHint}>
          {text.stable}
        </Badge>
      )}
      {labels.includes("canary") && (
        <Badge kind="warn" title={text.canaryHint(share)}>
          {text.canary(share)}
        </Badge>
      )}
      {labels.includes("shadow") && (
        <Badge kind="accent" title={text.shadowHint}>
          {text.shadow}
        </Badge>
      )}
      {labels.includes("previous") && <Badge title={text.previousHint}>{text.previous}</Badge>}
      {(state !== "ready" || labels.length === 0) && (
        <Badge kind={state === "failed" ? "bad" : undefined}>{text.states[state]}</Badge>
      )}
    </>
  );
}

interface StepsProps {
  version: VersionInfo;
  /** Without a version that serves there is nothing to be a shadow or a canary of. */
  hasStable: boolean;
  changer: Changer;
}

/** The way of a version: shadow, canary, stable; each with a way back. */
export function Steps({ version, hasStable, changer }: StepsProps) {
  const [share, setShare] = useState(FIRST_SHARE);
  const { version: number, labels, state } = version;
  const blocked = blockedFor("admin");
  const { busy } = changer;
  if (labels.includes("stable") || state === "failed") return null;
  const isShadow = labels.includes("shadow");
  const isCanary = labels.includes("canary");
  return (
    <>
      {hasStable && !isShadow && !isCanary && (
        <Button compact blocked={blocked} disabled={busy} onClick={() => changer.shadow(number)}>
          {text.asShadow}
        </Button>
      )}
      {hasStable && !isCanary && (
        <span class="row joined">
          <Button
            compact
            kind={isShadow ? "primary" : undefined}
            blocked={blocked}
            disabled={busy}
            onClick={() => changer.canary(number, share)}
          >
            {text.asCanary}
          </Button>
          <CompactSelect
            label={text.share}
            value={String(share)}
            options={SHARES.map((value) => ({ value: String(value), label: percent(value) }))}
            onChange={(value) => setShare(Number(value))}
          />
        </span>
      )}
      <Button
        compact
        kind={isCanary || !hasStable ? "primary" : undefined}
        blocked={blocked}
        disabled={busy}
        onClick={() => changer.stable(number)}
      >
        {text.asStable}
      </Button>
      {isShadow && (
        <Button
          compact
          blocked={blocked}
          disabled={busy}
          onClick={() => changer.stop(number, "shadow")}
        >
          {text.stopShadow}
        </Button>
      )}
      {isCanary && (
        <Button
          compact
          blocked={blocked}
          disabled={busy}
          onClick={() => changer.stop(number, "canary")}
        >
          {text.stopCanary}
        </Button>
      )}
    </>
  );
}
