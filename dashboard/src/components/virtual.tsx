import type { ComponentChildren, Ref } from "preact";
import { useEffect, useImperativeHandle, useLayoutEffect, useRef, useState } from "preact/hooks";

export interface VirtualHandle {
  /** Scrolls so far that the item is in view. */
  reveal: (index: number) => void;
  /** How many items lie in a row now, for arrow keys. */
  columns: () => number;
}

interface VirtualGridProps<T> {
  items: readonly T[];
  keyOf: (item: T) => string;
  render: (item: T, index: number) => ComponentChildren;
  /** The least width of a column; 0 makes it a list of one column. */
  minWidth: number;
  /** The height of every row, which its items fill. */
  rowHeight: number;
  gap?: number;
  label: string;
  handle?: Ref<VirtualHandle>;
  /** Told when the end comes near, to load more. */
  onNearEnd?: () => void;
}

interface Range {
  columns: number;
  first: number;
  last: number;
}

const ROWS_AROUND = 2;

/** A grid of many items, of which only those near the view are drawn; the document scrolls, not the grid. */
export function VirtualGrid<T>(props: VirtualGridProps<T>) {
  const { items, minWidth, rowHeight, gap = 12 } = props;
  const ref = useRef<HTMLDivElement>(null);
  const [range, setRange] = useState<Range>({ columns: 1, first: 0, last: 8 });
  const step = rowHeight + gap;
  const rows = Math.ceil(items.length / range.columns);

  const measure = () => {
    const element = ref.current;
    if (!element) return;
    const box = element.getBoundingClientRect();
    const fitting = minWidth > 0 ? Math.floor((box.width + gap) / (minWidth + gap)) : 1;
    const columns = Math.max(1, fitting);
    const first = Math.max(0, Math.floor(-box.top / step) - ROWS_AROUND);
    const last = Math.max(first, Math.ceil((innerHeight - box.top) / step) + ROWS_AROUND);
    setRange((before) =>
      before.columns === columns && before.first === first && before.last === last
        ? before
        : { columns, first, last },
    );
  };

  useLayoutEffect(measure, [items.length, minWidth, rowHeight, gap]);
  useEffect(() => {
    let frame = 0;
    const soon = () => {
      cancelAnimationFrame(frame);
      frame = requestAnimationFrame(measure);
    };
    const observer = new ResizeObserver(soon);
    if (ref.current) observer.observe(ref.current);
    addEventListener("scroll", soon, { passive: true });
    addEventListener("resize", soon);
    return () => {
      cancelAnimationFrame(frame);
      observer.disconnect();
      removeEventListener("scroll", soon);
      removeEventListener("resize", soon);
    };
  }, [minWidth, rowHeight, gap]);

  useImperativeHandle(
    props.handle ?? null,
    () => ({
      columns: () => range.columns,
      reveal: (index) => {
        const box = ref.current?.getBoundingClientRect();
        if (!box) return;
        const top = box.top + Math.floor(index / range.columns) * step;
        if (top < step / 2) scrollBy({ top: top - step / 2 });
        else if (top + step > innerHeight) scrollBy({ top: top + step - innerHeight + step / 2 });
      },
    }),
    [range.columns, step],
  );

  const atEnd = range.last >= rows - ROWS_AROUND;
  const nearEnd = useRef(props.onNearEnd);
  nearEnd.current = props.onNearEnd;
  useEffect(() => {
    if (atEnd) nearEnd.current?.();
  }, [atEnd, items.length]);

  const from = range.first * range.columns;
  const shown = items.slice(from, (range.last + 1) * range.columns);
  return (
    <div ref={ref} class="virtual" style={{ height: `${Math.max(0, rows * step - gap)}px` }}>
      <ul
        aria-label={props.label}
        style={{
          transform: `translateY(${range.first * step}px)`,
          gridTemplateColumns: `repeat(${range.columns}, minmax(0, 1fr))`,
          gridAutoRows: `${rowHeight}px`,
          gap: `${gap}px`,
        }}
      >
        {shown.map((item, at) => (
          <li key={props.keyOf(item)} aria-setsize={items.length} aria-posinset={from + at + 1}>
            {props.render(item, from + at)}
          </li>
        ))}
      </ul>
    </div>
  );
}
