import { signal } from "@preact/signals";
import type { ComponentChildren } from "preact";
import { useEffect, useId, useRef } from "preact/hooks";
import { text as common } from "../texts/common";
import { Button } from "./button";

interface DialogProps {
  title: string;
  onClose: () => void;
  children: ComponentChildren;
  wide?: boolean;
  /** Without it there is no way out but what the dialog offers. */
  closable?: boolean;
  /** Hears of keys wherever the focus is in it. */
  onKeyDown?: (event: KeyboardEvent) => void;
}

/** A modal dialog: the browser keeps the focus within it, and it goes back to where it was. */
export function Dialog(props: DialogProps) {
  const { title, onClose, children, wide, closable = true, onKeyDown } = props;
  const ref = useRef<HTMLDialogElement>(null);
  const id = useId();
  useEffect(() => {
    const dialog = ref.current;
    const before = document.activeElement;
    if (dialog && !dialog.open) dialog.showModal();
    return () => {
      dialog?.close();
      // A dialog that has left the document gives no focus back by itself.
      if (before instanceof HTMLElement) before.focus();
    };
  }, []);
  return (
    <dialog
      ref={ref}
      class={wide ? "dialog wide" : "dialog"}
      aria-labelledby={id}
      onCancel={(event) => {
        event.preventDefault();
        if (closable) onClose();
      }}
      onClick={(event) => {
        if (closable && event.target === ref.current) onClose();
      }}
      onKeyDown={onKeyDown}
    >
      <div class="dialog-head">
        <h2 id={id}>{title}</h2>
        {closable && <Button kind="plain" icon="close" label={common.close} onClick={onClose} />}
      </div>
      <div class="dialog-body">{children}</div>
    </dialog>
  );
}

export interface Question {
  title: string;
  text: string;
  /** What the button says: what is done, not "OK". */
  action: string;
  danger?: boolean;
}

const asked = signal<(Question & { answer: (yes: boolean) => void }) | undefined>(undefined);

/** Asks whether to do something; true if the person says so. */
export function confirm(question: Question): Promise<boolean> {
  asked.value?.answer(false);
  return new Promise((resolve) => {
    asked.value = {
      ...question,
      answer: (yes) => {
        asked.value = undefined;
        resolve(yes);
      },
    };
  });
}

/** Shows what `confirm` asks; once in the page. */
export function Confirmations() {
  const question = asked.value;
  if (!question) return null;
  return (
    <Dialog title={question.title} onClose={() => question.answer(false)}>
      <p>{question.text}</p>
      <div class="dialog-foot">
        <Button onClick={() => question.answer(false)}>{common.cancel}</Button>
        <Button
          kind="primary"
          class={question.danger ? "danger" : ""}
          onClick={() => question.answer(true)}
        >
          {question.action}
        </Button>
      </div>
    </Dialog>
  );
}
