import { describe, expect, it } from "vitest";
import { NOTHING, clicked, kept, meant, pressed } from "./selection";

const ITEMS = ["a", "b", "c", "d", "e", "f", "g"];
const LAYOUT = { columns: 3, rows: 2 };
const ALONE = { shift: false, ctrl: false };
const SHIFT = { shift: true, ctrl: false };
const CTRL = { shift: false, ctrl: true };

describe("a click", () => {
  it("selects one, and another instead", () => {
    const first = clicked(NOTHING, ITEMS, 1, ALONE);
    expect([...clicked(first, ITEMS, 4, ALONE).names]).toEqual(["e"]);
  });

  it("selects a range with shift, either way, from where it began", () => {
    const middle = clicked(NOTHING, ITEMS, 3, ALONE);
    const down = clicked(middle, ITEMS, 5, SHIFT);
    expect([...down.names]).toEqual(["d", "e", "f"]);
    expect([...clicked(down, ITEMS, 1, SHIFT).names]).toEqual(["b", "c", "d"]);
  });

  it("adds and takes away with ctrl", () => {
    const two = clicked(clicked(NOTHING, ITEMS, 0, ALONE), ITEMS, 2, CTRL);
    expect([...two.names]).toEqual(["a", "c"]);
    expect([...clicked(two, ITEMS, 0, CTRL).names]).toEqual(["c"]);
    const both = clicked(two, ITEMS, 4, { shift: true, ctrl: true });
    expect([...both.names].sort()).toEqual(["a", "c", "d", "e"]);
  });

  it("beside the list changes nothing", () => {
    expect(clicked(NOTHING, ITEMS, 7, ALONE)).toBe(NOTHING);
  });
});

describe("keys", () => {
  const press = (keys: string[], held = ALONE, from = NOTHING) =>
    keys.reduce(
      (selection, key) => pressed(selection, ITEMS, key, held, LAYOUT) ?? selection,
      from,
    );

  it("move without selecting", () => {
    expect(press(["ArrowDown", "ArrowRight"])).toMatchObject({ focus: 4, names: new Set() });
    expect(press(["ArrowUp"]).focus).toBe(0);
    expect(press(["End", "ArrowRight"]).focus).toBe(6);
    expect(press(["End", "ArrowDown"]).focus).toBe(6);
  });

  it("go down into a last row that is short", () => {
    expect(press(["ArrowRight", "ArrowDown", "ArrowDown"]).focus).toBe(6);
  });

  it("select with space and extend with shift", () => {
    expect([...press(["ArrowRight", " "]).names]).toEqual(["b"]);
    const extended = press(["ArrowRight", "ArrowDown"], SHIFT, press(["ArrowRight"]));
    expect([...extended.names]).toEqual(["b", "c", "d", "e", "f"]);
    expect([...press(["ArrowUp"], SHIFT, extended).names]).toEqual(["b", "c"]);
  });

  it("select all and nothing", () => {
    const all = press(["a"], CTRL);
    expect(all.names.size).toBe(7);
    expect(press(["Escape"], ALONE, all).names.size).toBe(0);
  });

  it("that mean nothing are left to the page", () => {
    expect(pressed(NOTHING, ITEMS, "x", ALONE, LAYOUT)).toBeUndefined();
    expect(pressed(NOTHING, ITEMS, "Escape", ALONE, LAYOUT)).toBeUndefined();
    expect(pressed(NOTHING, [], "ArrowDown", ALONE, LAYOUT)).toBeUndefined();
  });
});

describe("a list that changes", () => {
  it("keeps what is still there", () => {
    const selection = { names: new Set(["a", "g"]), focus: 6, anchor: 6 };
    expect(kept(selection, ["a", "b"])).toEqual({ names: new Set(["a"]), focus: 1, anchor: 1 });
    expect(kept(selection, [])).toEqual({ names: new Set(), focus: 0, anchor: 0 });
  });

  it("an action is about what is selected, else about what has the focus", () => {
    expect(meant({ names: new Set(["c", "a"]), focus: 5, anchor: 0 }, ITEMS)).toEqual(["a", "c"]);
    expect(meant({ names: new Set(), focus: 5, anchor: 0 }, ITEMS)).toEqual(["f"]);
    expect(meant(NOTHING, [])).toEqual([]);
  });
});
