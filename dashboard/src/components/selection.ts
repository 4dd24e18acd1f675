/** Which items of a list are selected, by click and by key, as in a file manager. */

export interface Selection {
  /** Names of the selected items. */
  readonly names: ReadonlySet<string>;
  /** Where the keyboard is. */
  readonly focus: number;
  /** Where a range begins. */
  readonly anchor: number;
}

/** What is held down beside a click or a key. */
export interface Held {
  readonly shift: boolean;
  readonly ctrl: boolean;
}

/** How the items lie. */
export interface Layout {
  readonly columns: number;
  /** How many rows are in view. */
  readonly rows: number;
}

export const NOTHING: Selection = { names: new Set(), focus: 0, anchor: 0 };

function range(items: readonly string[], from: number, to: number): string[] {
  return items.slice(Math.min(from, to), Math.max(from, to) + 1);
}

function toggled(names: ReadonlySet<string>, name: string): Set<string> {
  const changed = new Set(names);
  if (!changed.delete(name)) {
    changed.add(name);
  }
  return changed;
}

/** After a click: alone it selects one, with ctrl it adds or takes away, with shift it selects a range. */
export function clicked(
  selection: Selection,
  items: readonly string[],
  index: number,
  held: Held,
): Selection {
  const name = items[index];
  if (name === undefined) {
    return selection;
  }
  if (held.shift) {
    const names = range(items, selection.anchor, index);
    const before = held.ctrl ? [...selection.names] : [];
    return { names: new Set([...before, ...names]), focus: index, anchor: selection.anchor };
  }
  const names = held.ctrl ? toggled(selection.names, name) : new Set([name]);
  return { names, focus: index, anchor: index };
}

function stepped(key: string, focus: number, last: number, layout: Layout): number | undefined {
  const page = layout.columns * Math.max(layout.rows - 1, 1);
  const steps: Record<string, number> = {
    ArrowLeft: focus - 1,
    ArrowRight: focus + 1,
    ArrowUp: focus - layout.columns,
    ArrowDown: focus + layout.columns,
    PageUp: focus - page,
    PageDown: focus + page,
    Home: 0,
    End: last,
  };
  const target = steps[key];
  if (target === undefined) {
    return undefined;
  }
  // Up from the first row and down from the last stay where they are; the rest goes as far as there are items.
  const isVertical = key === "ArrowUp" || key === "ArrowDown";
  if (isVertical && (target < 0 || target > last)) {
    const isLastRow = Math.floor(focus / layout.columns) === Math.floor(last / layout.columns);
    return key === "ArrowDown" && !isLastRow ? last : focus;
  }
  return Math.min(Math.max(target, 0), last);
}

/** After a key, or `undefined` where the key means nothing here. */
export function pressed(
  selection: Selection,
  items: readonly string[],
  key: string,
  held: Held,
  layout: Layout,
): Selection | undefined {
  if (items.length === 0) {
    return undefined;
  }
  const last = items.length - 1;
  const focus = Math.min(selection.focus, last);
  if (key === "Escape") {
    return selection.names.size > 0 ? { ...selection, names: new Set() } : undefined;
  }
  if (key === " ") {
    const name = items[focus];
    return name === undefined
      ? undefined
      : { names: toggled(selection.names, name), focus, anchor: focus };
  }
  if (held.ctrl && key.toLowerCase() === "a") {
    return { ...selection, names: new Set(items), anchor: 0 };
  }
  const target = stepped(key, focus, last, layout);
  if (target === undefined) {
    return undefined;
  }
  if (held.shift) {
    return {
      names: new Set(range(items, selection.anchor, target)),
      focus: target,
      anchor: selection.anchor,
    };
  }
  return { names: selection.names, focus: target, anchor: target };
}

/** What is left of a selection where the list has changed. */
export function kept(selection: Selection, items: readonly string[]): Selection {
  const there = new Set(items);
  const names = new Set([...selection.names].filter((name) => there.has(name)));
  const last = Math.max(items.length - 1, 0);
  return {
    names,
    focus: Math.min(selection.focus, last),
    anchor: Math.min(selection.anchor, last),
  };
}

/** What an action is about: the selected items in their order or, where there are none, the one that has the focus. */
export function meant(selection: Selection, items: readonly string[]): string[] {
  if (selection.names.size > 0) {
    return items.filter((name) => selection.names.has(name));
  }
  const focused = items[selection.focus];
  return focused === undefined ? [] : [focused];
}
