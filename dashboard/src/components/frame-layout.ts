/** Which rows of a long grid are in view. */

export interface Grid {
  columns: number;
  /** Width of an item, without the gap. */
  width: number;
  /** Height of a row, with the gap. */
  rowHeight: number;
  height: number;
}

export interface Window {
  /** Index of the first item that is drawn. */
  first: number;
  /** Index behind the last. */
  end: number;
}

/** How items of about `wanted` pixels are laid out; `extra` is what an item is higher than 3/4 of its width. */
export function gridOf(
  count: number,
  room: number,
  wanted: number,
  gap: number,
  extra: number,
): Grid {
  const columns = Math.max(1, Math.floor((room + gap) / (wanted + gap)));
  const width = Math.max(1, (room - gap * (columns - 1)) / columns);
  const rowHeight = Math.round(width * 0.75) + extra + gap;
  return { columns, width, rowHeight, height: Math.ceil(count / columns) * rowHeight };
}

/** The items that are drawn where `height` pixels from `top` are in view, with a few rows around. */
export function windowOf(grid: Grid, count: number, top: number, height: number): Window {
  const above = 2;
  const firstRow = Math.max(0, Math.floor(top / grid.rowHeight) - above);
  const endRow = Math.ceil((top + height) / grid.rowHeight) + above;
  return {
    first: Math.min(firstRow * grid.columns, count),
    end: Math.min(endRow * grid.columns, count),
  };
}

/** Where to scroll so that an item is in view; `undefined` where it is. */
export function revealed(
  grid: Grid,
  index: number,
  top: number,
  height: number,
): number | undefined {
  const itemTop = Math.floor(index / grid.columns) * grid.rowHeight;
  if (itemTop < top) return itemTop;
  if (itemTop + grid.rowHeight > top + height) return itemTop + grid.rowHeight - height;
  return undefined;
}
