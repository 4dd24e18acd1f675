import { useEffect, useRef } from "preact/hooks";
import { text as common } from "../texts/common";
import { Button } from "./button";
import { dismiss, shown, toastError } from "./toast";

/** What was told lately. */
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
