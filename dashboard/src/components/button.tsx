import type { ComponentChildren, Ref } from "preact";
import { useId } from "preact/hooks";
import { Icon, type IconName } from "./icons";
import { toast } from "./toast";

interface ButtonProps {
  children?: ComponentChildren;
  onClick?: (event: MouseEvent) => void;
  /** The one thing to do here, or something that cannot be taken back. */
  kind?: "primary" | "danger" | "plain";
  icon?: IconName;
  /** What it does, for buttons that show an icon only. */
  label?: string;
  compact?: boolean;
  disabled?: boolean;
  /** Why it is not allowed: it stays in reach, and says so. */
  blocked?: string;
  busy?: boolean;
  pressed?: boolean;
  type?: "button" | "submit";
  class?: string;
  buttonRef?: Ref<HTMLButtonElement>;
}

export function Button(props: ButtonProps) {
  const { kind, icon, label, blocked, busy } = props;
  const id = useId();
  const classes = ["button", kind, props.compact && "compact", icon && label && "icon"];
  const click = (event: MouseEvent) => {
    if (blocked) {
      event.preventDefault();
      toast({ text: blocked, kind: "bad" });
    } else if (busy) event.preventDefault();
    else props.onClick?.(event);
  };
  return (
    <button
      ref={props.buttonRef}
      type={props.type ?? "button"}
      class={[...classes, props.class].filter(Boolean).join(" ")}
      onClick={click}
      disabled={props.disabled}
      aria-disabled={blocked || busy ? "true" : undefined}
      aria-describedby={blocked ? id : undefined}
      aria-pressed={props.pressed}
      aria-busy={busy ? "true" : undefined}
      aria-label={label}
      title={blocked ?? label}
    >
      {busy ? <span class="spinner" aria-hidden="true" /> : icon && <Icon name={icon} />}
      {props.children}
      {blocked && (
        <span id={id} class="hidden">
          {blocked}
        </span>
      )}
    </button>
  );
}
