import { describe, expect, it } from "vitest";
import { drawn, extended, RIBBON_MS, type Stretch } from "./ribbon";

const kitchen = { room: "kitchen", known: true };
const hall = { room: "hall", known: true };

describe("a ribbon", () => {
  it("grows while the room stays, and begins another stretch when it changes", () => {
    let ribbon: Stretch[] = [];
    for (const at of [1000, 2000, 3000]) ribbon = extended(ribbon, kitchen, at);
    ribbon = extended(ribbon, hall, 4000);
    ribbon = extended(ribbon, { ...hall, known: false }, 5000);
    expect(ribbon).toEqual([
      { ...kitchen, from: 1000, until: 4000 },
      { ...hall, from: 4000, until: 5000 },
      { room: "hall", known: false, from: 5000, until: 5000 },
    ]);
  });

  it("leaves a gap where nothing was heard", () => {
    const ribbon = extended([{ ...kitchen, from: 0, until: 1000 }], kitchen, 60_000);
    expect(ribbon.map(({ from, until }) => [from, until])).toEqual([
      [0, 1000],
      [60_000, 60_000],
    ]);
  });

  it("forgets what is too old, and what a clock that was set back has not reached", () => {
    const old = { ...kitchen, from: 0, until: 1000 };
    const late = { ...hall, from: RIBBON_MS * 3, until: RIBBON_MS * 3 };
    const ribbon = extended([old, late], hall, RIBBON_MS * 2);
    expect(ribbon).toEqual([{ ...hall, from: RIBBON_MS * 2, until: RIBBON_MS * 2 }]);
  });

  it("is drawn within its width", () => {
    const parts = drawn([{ ...kitchen, from: -500, until: 500 }], 1000, 1000);
    expect(parts.map(({ left, width }) => [left, width])).toEqual([[0, 0.5]]);
  });
});
