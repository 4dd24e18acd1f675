import { expect, it } from "vitest";
import { gridOf, revealed, windowOf } from "./frame-layout";

const grid = gridOf(10_000, 1000, 150, 10, 30);

it("items fill the room", () => {
  expect(grid.columns).toBe(6);
  expect(6 * grid.width + 5 * 10).toBeCloseTo(1000);
  expect(grid.height).toBe(Math.ceil(10_000 / 6) * grid.rowHeight);
  expect(gridOf(3, 80, 150, 10, 30).columns).toBe(1);
});

it("few of many items are drawn, wherever the reader is", () => {
  for (const top of [0, 50_000, grid.height - 600]) {
    const { first, end } = windowOf(grid, 10_000, top, 600);
    expect(first * grid.rowHeight).toBeLessThanOrEqual(top * grid.columns);
    expect(end - first).toBeLessThan(60);
    expect(end).toBeGreaterThan(first);
  }
  expect(windowOf(grid, 10_000, 0, 600).first).toBe(0);
  expect(windowOf(grid, 10_000, grid.height - 600, 600).end).toBe(10_000);
  expect(windowOf(grid, 0, 0, 600)).toEqual({ first: 0, end: 0 });
});

it("an item comes into view by the shortest way", () => {
  const { rowHeight } = grid;
  expect(revealed(grid, 0, 0, 600)).toBeUndefined();
  expect(revealed(grid, 0, 500, 600)).toBe(0);
  expect(revealed(grid, 600, 0, 600)).toBe(101 * rowHeight - 600);
});
