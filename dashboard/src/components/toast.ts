import { signal } from "@preact/signals";
import { messageOf } from "../api/client";

export interface Toast {
  text: string;
  kind?: "good" | "bad";
  /** Takes back what was just done. */
  undo?: () => Promise<void>;
}

const SHOWN_MS = 6000;
const SHOWN_WITH_UNDO_MS = 15_000;
const MOST = 4;

/** Those that are shown now. */
export const shown = signal<(Toast & { id: number })[]>([]);
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

/** Takes one away. */
export function dismiss(id: number): void {
  shown.value = shown.value.filter((other) => other.id !== id);
}
