import type { ComponentChildren } from "preact";
import { useEffect } from "preact/hooks";
import { messageOf } from "../api/client";
import { text as common } from "../texts/common";
import { Button } from "./button";
import { Icon, type IconName } from "./icons";

/** The head of a page: its title, and what can be done on all of it. */
export function PageHead(props: { title: string; lead?: string; children?: ComponentChildren }) {
  useEffect(() => {
    document.title = `${props.title} · ${common.product}`;
  }, [props.title]);
  return (
    <header class="page-head">
      <h1>{props.title}</h1>
      {props.children}
      {props.lead && <p class="lead">{props.lead}</p>}
    </header>
  );
}

/** Something to know before going on. */
export function Note(props: { kind?: "good" | "warn" | "bad"; children: ComponentChildren }) {
  return (
    <div class={`note ${props.kind ?? ""}`} role={props.kind === "bad" ? "alert" : undefined}>
      {props.children}
    </div>
  );
}

/** What went wrong, and a way to try again. */
export function ErrorNote(props: { error: unknown; onRetry?: () => void }) {
  return (
    <Note kind="bad">
      <p>{messageOf(props.error)}</p>
      {props.onRetry && (
        <Button compact onClick={props.onRetry}>
          {common.retry}
        </Button>
      )}
    </Note>
  );
}

/** Where there is nothing: why, and what to do. */
export function EmptyState(props: {
  icon: IconName;
  title: string;
  text?: string;
  children?: ComponentChildren;
}) {
  return (
    <div class="empty">
      <Icon name={props.icon} size={40} />
      <h2>{props.title}</h2>
      {props.text && <p>{props.text}</p>}
      {props.children}
    </div>
  );
}

export function Busy({ label = common.loading }: { label?: string }) {
  return (
    <div class="busy" role="status">
      <span class="spinner" aria-hidden="true" />
      {label}
    </div>
  );
}

export function Badge(props: {
  kind?: "good" | "warn" | "bad" | "accent";
  title?: string;
  children: ComponentChildren;
}) {
  return (
    <span class={`badge ${props.kind ?? ""}`} title={props.title}>
      {props.children}
    </span>
  );
}
