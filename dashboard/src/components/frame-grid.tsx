import type { ComponentChildren } from "preact";
import { useEffect, useId, useLayoutEffect, useMemo, useRef, useState } from "preact/hooks";
import { text } from "../texts/frames";
import "./frame-grid.css";
import { clicked, pressed, type Held, type Selection } from "./selection";
import { gridOf, revealed, windowOf, type Grid, type Window } from "./frame-layout";

/** What is dragged from a grid, as far as the page that it is dropped on can tell. */
export const FRAMES_TYPE = "application/x-roomsight-frames";

/** What a frame looks like. */
export interface Tile {
  picture: string;
  /** What is told of it to those who do not see it. */
  label: string;
  caption?: ComponentChildren;
  /** Drawn over the picture. */
  mark?: ComponentChildren;
}

export interface FrameGridProps {
  label: string;
  /** The names of the frames that are loaded, in order. */
  names: readonly string[];
  /** How many there are, loaded or not. */
  total: number;
  selection: Selection;
  tile: (name: string, index: number) => Tile;
  /** Height below the pictures. */
  captionHeight?: number;
  tileWidth?: number;
  onSelect: (selection: Selection) => void;
  /** Hears that a frame comes into view that is not loaded. */
  onNeed: (index: number) => void;
  /** Ctrl+A, where not all are loaded. */
  onSelectAll: () => void;
  /** Enter or a double click. */
  onOpen?: (name: string) => void;
  /** A key that means nothing to the grid; returns whether it did something. */
  onKey?: (key: string) => boolean;
  /** What is dragged; none where frames cannot be. */
  onDrag?: (names: readonly string[]) => void;
}

interface Box {
  width: number;
  height: number;
  /** Where the first row in view begins. */
  top: number;
}

const GAP = 8;

const held = (event: MouseEvent | KeyboardEvent): Held => ({
  shift: event.shiftKey,
  ctrl: event.ctrlKey || event.metaKey,
});

/** A list of pictures that stays fast however many there are, with selection by mouse, finger and keyboard. */
export function FrameGrid(props: FrameGridProps) {
  const { names, total, selection, captionHeight = 0, tileWidth = 148 } = props;
  const scroller = useRef<HTMLUListElement>(null);
  const [box, setBox] = useState<Box>({ width: 0, height: 0, top: 0 });
  const id = useId();
  const latest = useRef(props);
  latest.current = props;
  const grid = gridOf(total, box.width, tileWidth, GAP, captionHeight);
  const drawn = windowOf(grid, total, box.top, box.height);

  useLayoutEffect(() => {
    const element = scroller.current;
    if (!element) return undefined;
    const { rowHeight } = grid;
    const measure = () =>
      setBox((before) => {
        const width = element.clientWidth - 2 * GAP;
        const height = element.clientHeight;
        // Only a row that comes into view changes what is drawn.
        const top = Math.floor(element.scrollTop / rowHeight) * rowHeight;
        const isSame = before.width === width && before.height === height && before.top === top;
        return isSame ? before : { width, height, top };
      });
    const observer = new ResizeObserver(measure);
    observer.observe(element);
    element.addEventListener("scroll", measure, { passive: true });
    return () => {
      observer.disconnect();
      element.removeEventListener("scroll", measure);
    };
  }, [grid.rowHeight]);

  useEffect(() => {
    if (drawn.end > names.length) props.onNeed(drawn.end - 1);
  }, [drawn.end, names.length, total]);

  useEffect(() => {
    const element = scroller.current;
    if (!element || names.length === 0) return;
    const to = revealed(grid, selection.focus, element.scrollTop, element.clientHeight - 2 * GAP);
    if (to !== undefined) element.scrollTop = to;
  }, [selection.focus]);

  const whenPressed = (event: KeyboardEvent) => {
    const focused = names[selection.focus];
    const isAll = held(event).ctrl && event.key.toLowerCase() === "a";
    if (isAll && names.length < total) {
      props.onSelectAll();
    } else if (event.key === "Enter" && focused !== undefined && props.onOpen) {
      props.onOpen(focused);
    } else {
      const rows = Math.max(1, Math.floor(box.height / grid.rowHeight));
      const layout = { columns: grid.columns, rows };
      const next = pressed(selection, names, event.key, held(event), layout);
      if (next) props.onSelect(next);
      else if (held(event).ctrl || event.altKey || !props.onKey?.(event.key)) return;
    }
    event.preventDefault();
  };

  const focusedName = names[selection.focus];
  return (
    <ul
      ref={scroller}
      class="frames"
      role="listbox"
      tabIndex={0}
      aria-label={props.label}
      aria-multiselectable="true"
      aria-activedescendant={
        focusedName !== undefined && isDrawn(drawn, selection.focus)
          ? `${id}-${selection.focus}`
          : undefined
      }
      onKeyDown={whenPressed}
    >
      <li class="frames-height" role="presentation" style={{ height: `${grid.height}px` }} />
      {box.width > 0 &&
        indices(drawn).map((index) => {
          const name = names[index];
          if (name === undefined) {
            const place = placeOf(grid, index);
            return <li key={index} class="frame waiting" role="presentation" style={place} />;
          }
          return (
            <FrameTile
              key={name}
              id={`${id}-${index}`}
              index={index}
              name={name}
              total={total}
              grid={grid}
              tile={props.tile}
              isSelected={selection.names.has(name)}
              isFocused={selection.focus === index}
              latest={latest}
            />
          );
        })}
    </ul>
  );
}

const isDrawn = ({ first, end }: Window, index: number) => index >= first && index < end;

const indices = ({ first, end }: Window) =>
  Array.from({ length: end - first }, (_, offset) => first + offset);

function placeOf(grid: Grid, index: number) {
  const x = GAP + (index % grid.columns) * (grid.width + GAP);
  const y = GAP + Math.floor(index / grid.columns) * grid.rowHeight;
  return {
    transform: `translate(${x}px, ${y}px)`,
    width: `${grid.width}px`,
    height: `${grid.rowHeight - GAP}px`,
  };
}

interface FrameTileProps {
  id: string;
  index: number;
  name: string;
  total: number;
  grid: Grid;
  tile: FrameGridProps["tile"];
  isSelected: boolean;
  isFocused: boolean;
  latest: { current: FrameGridProps };
}

function FrameTile(props: FrameTileProps) {
  const { id, index, name, total, grid, tile, isSelected, isFocused, latest } = props;
  const [isMissing, setMissing] = useState(false);

  const whenClicked = (event: MouseEvent) => {
    const { selection, names, onSelect } = latest.current;
    // A finger has no ctrl key, and the mark in the corner does what ctrl does.
    const isFinger = (event as PointerEvent).pointerType === "touch";
    const isMark = (event.target as Element).closest(".frame-check") !== null;
    const keys = held(event);
    const ctrl = keys.ctrl || isFinger || (isMark && !keys.shift);
    onSelect(clicked(selection, names, index, { ...keys, ctrl }));
  };

  const whenDragged = (event: DragEvent) => {
    const { selection, names, onSelect, onDrag } = latest.current;
    const isOne = !selection.names.has(name);
    const dragged = isOne ? [name] : names.filter((other) => selection.names.has(other));
    if (isOne) onSelect({ names: new Set(dragged), focus: index, anchor: index });
    event.dataTransfer?.setData(FRAMES_TYPE, String(dragged.length));
    if (event.dataTransfer) event.dataTransfer.effectAllowed = "move";
    onDrag?.(dragged);
  };

  const isDraggable = latest.current.onDrag !== undefined;
  // While the list scrolls, most of what is in view stays as it is.
  return useMemo(() => {
    const { picture, label, caption, mark } = tile(name, index);
    const state = [isSelected && "selected", isFocused && "focused"];
    return (
      <li
        id={id}
        class={["frame", ...state].filter(Boolean).join(" ")}
        style={placeOf(grid, index)}
        role="option"
        aria-selected={isSelected}
        aria-label={label}
        aria-posinset={index + 1}
        aria-setsize={total}
        draggable={isDraggable}
        onClick={whenClicked}
        onDblClick={() => latest.current.onOpen?.(name)}
        onDragStart={whenDragged}
      >
        <span class="frame-picture">
          {isMissing ? (
            <span class="missing">{text.pictureMissing}</span>
          ) : (
            <img
              src={picture}
              alt=""
              draggable={false}
              decoding="async"
              onError={() => setMissing(true)}
            />
          )}
          <span class="frame-check" aria-hidden="true" />
          {mark}
        </span>
        {caption !== undefined && <span class="frame-caption">{caption}</span>}
      </li>
    );
  }, [
    ...[id, index, name, total, grid.columns, grid.width, grid.rowHeight, tile],
    ...[isSelected, isFocused, isMissing, isDraggable],
  ]);
}
