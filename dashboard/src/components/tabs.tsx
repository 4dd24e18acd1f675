import type { ComponentChildren } from "preact";
import { useId } from "preact/hooks";

interface Tab<T extends string> {
  id: T;
  label: string;
}

/** Tabs and the panel of the chosen one; arrow keys go from one to the next. */
export function Tabs<T extends string>(props: {
  label: string;
  tabs: Tab<T>[];
  chosen: T;
  onChoose: (id: T) => void;
  children: ComponentChildren;
}) {
  const base = useId();
  const move = (event: KeyboardEvent) => {
    const at = props.tabs.findIndex(({ id }) => id === props.chosen);
    const last = props.tabs.length - 1;
    const to = { ArrowRight: at + 1, ArrowLeft: at - 1, Home: 0, End: last }[event.key];
    const next = to === undefined ? undefined : props.tabs[Math.min(last, Math.max(0, to))];
    if (!next) return;
    event.preventDefault();
    props.onChoose(next.id);
    document.getElementById(`${base}-${next.id}`)?.focus();
  };
  return (
    <div>
      <div class="tabs" role="tablist" aria-label={props.label} onKeyDown={move}>
        {props.tabs.map(({ id, label }) => (
          <button
            key={id}
            id={`${base}-${id}`}
            type="button"
            role="tab"
            aria-selected={id === props.chosen}
            aria-controls={`${base}-panel`}
            tabIndex={id === props.chosen ? 0 : -1}
            onClick={() => props.onChoose(id)}
          >
            {label}
          </button>
        ))}
      </div>
      <div id={`${base}-panel`} role="tabpanel" aria-labelledby={`${base}-${props.chosen}`}>
        {props.children}
      </div>
    </div>
  );
}
