import { signal } from "@preact/signals";
import { useEffect, useRef } from "preact/hooks";
import { messageOf } from "../api/client";
import { text as common } from "../texts/common";
import { Button } from "./button";

export interface Toast {
  text: string;
  kind?: "good" | "bad";
  /** Takes back what was just done. */
  undo?: () => Promise<void>;
}

const SHOWN_MS = 6000;
const SHOWN_WITH_UNDO_MS = 15_000;
const MOST = 4;

const shown = signal<(Toast & { id: number })[]>([]);
let last = 0;

/** Tells what happened, for a few seconds. */
export function toast(what: Toast): void {
  last += 1;
  const id = last;
  const others = shown.value.filter((other) => other.text !== what.text || other.undo);
  shown.value = [...others, { ...what, id }].slice(-MOST);
  setTimeout(() => dismiss(id), what.undo ? SHOWN_WITH_UNDO_MS : SHOWN_MS);
}

/** Tells what went wrong. */
export function toastError(error: unknown): void {
  toast({ text: messageOf(error), kind: "bad" });
}

function dismiss(id: number): void {
  shown.value = shown.value.filter((other) => other.id !== id);
}

export function Toasts() {
  const ref = useRef<HTMLDivElement>(null);
  // As a popover they lie above an open dialog; the last one opened is on top.
  useEffect(() => {
    const element = ref.current;
    if (!element?.showPopover) return;
    if (element.matches(":popover-open")) element.hidePopover();
    if (shown.value.length > 0) element.showPopover();
  }, [shown.value]);
  return (
    <div ref={ref} class="toasts" popover="manual" aria-live="polite">
      {shown.value.map((item) => (
        <div key={item.id} class={`toast ${item.kind ?? "good"}`}>
          <p>{item.text}</p>
          {item.undo && (
            <Button
              compact
              icon="undo"
              onClick={() => {
                dismiss(item.id);
                item.undo?.().catch(toastError);
              }}
            >
              {common.undo}
            </Button>
          )}
          <Button
            kind="plain"
            compact
            icon="close"
            label={common.close}
            onClick={() => dismiss(item.id)}
          />
        </div>
      ))}
    </div>
  );
}
