import type { ComponentChildren } from "preact";
import { useId } from "preact/hooks";

interface FieldProps {
  label: string;
  hint?: string;
  /** What is wrong with the value. */
  wrong?: string;
}

function Field(
  props: FieldProps & { children: (ids: { id: string; described?: string }) => ComponentChildren },
) {
  const id = useId();
  const described = props.hint || props.wrong ? `${id}-more` : undefined;
  return (
    <div class="field">
      <label class="label" for={id}>
        {props.label}
      </label>
      {props.children({ id, described })}
      {described && (
        <span id={described} class={props.wrong ? "wrong" : "hint"}>
          {props.wrong ?? props.hint}
        </span>
      )}
    </div>
  );
}

export function TextField(
  props: FieldProps & {
    value: string;
    onInput: (value: string) => void;
    type?: "text" | "password" | "number" | "search";
    min?: number;
    max?: number;
    step?: number | "any";
    placeholder?: string;
    /** Values to choose from, while others may be typed. */
    suggestions?: string[];
    autoFocus?: boolean;
    required?: boolean;
    maxLength?: number;
    disabled?: boolean;
    autoComplete?: string;
  },
) {
  const listId = useId();
  // The types of JSX allow a list with some types only; it is given with those alone.
  const type = (props.type ?? "text") as "text";
  return (
    <Field {...props}>
      {({ id, described }) => (
        <>
          <input
            id={id}
            class="input"
            type={type}
            value={props.value}
            onInput={(event) => props.onInput(event.currentTarget.value)}
            aria-describedby={described}
            aria-invalid={props.wrong ? "true" : undefined}
            list={props.suggestions ? listId : undefined}
            min={props.min}
            max={props.max}
            step={props.step}
            placeholder={props.placeholder}
            autofocus={props.autoFocus}
            required={props.required}
            maxLength={props.maxLength}
            disabled={props.disabled}
            autocomplete={props.autoComplete ?? "off"}
            spellcheck={false}
          />
          {props.suggestions && (
            <datalist id={listId}>
              {props.suggestions.map((value) => (
                <option key={value} value={value} />
              ))}
            </datalist>
          )}
        </>
      )}
    </Field>
  );
}

export interface Option {
  value: string;
  label: string;
}

export function SelectField(
  props: FieldProps & {
    value: string;
    options: Option[];
    onChange: (value: string) => void;
    disabled?: boolean;
  },
) {
  return (
    <Field {...props}>
      {({ id, described }) => (
        <select
          id={id}
          class="input"
          value={props.value}
          onChange={(event) => props.onChange(event.currentTarget.value)}
          aria-describedby={described}
          disabled={props.disabled}
        >
          {props.options.map(({ value, label }) => (
            <option key={value} value={value}>
              {label}
            </option>
          ))}
        </select>
      )}
    </Field>
  );
}

/** A choice in a line of others, whose label only a screen reader tells. */
export function CompactSelect(props: {
  label: string;
  value: string;
  options: Option[];
  onChange: (value: string) => void;
}) {
  return (
    <select
      class="input compact"
      aria-label={props.label}
      value={props.value}
      onChange={(event) => props.onChange(event.currentTarget.value)}
    >
      {props.options.map(({ value, label }) => (
        <option key={value} value={value}>
          {label}
        </option>
      ))}
    </select>
  );
}

export function CheckField(props: {
  label: string;
  checked: boolean;
  onChange: (checked: boolean) => void;
  disabled?: boolean;
}) {
  return (
    <label class="check">
      <input
        type="checkbox"
        checked={props.checked}
        disabled={props.disabled}
        onChange={(event) => props.onChange(event.currentTarget.checked)}
      />
      <span>{props.label}</span>
    </label>
  );
}
