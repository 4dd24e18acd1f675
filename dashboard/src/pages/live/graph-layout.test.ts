import { describe, expect, it } from "vitest";
import { around, placed, waysOf } from "./graph-layout";

const rooms = ["attic", "bath", "cellar", "den", "hall", "kitchen"];
const transitions = [
  { from: "attic", to: "bath", rate: 0.9 },
  { from: "bath", to: "attic", rate: 0.4 },
  { from: "bath", to: "cellar", rate: 0.5 },
  { from: "cellar", to: "den", rate: 1 },
  { from: "den", to: "hall", rate: 1 },
  { from: "hall", to: "kitchen", rate: 1 },
  { from: "kitchen", to: "attic", rate: 0.001 },
];

describe("a graph of rooms", () => {
  it("has each way once, and none that is hardly gone", () => {
    const ways = waysOf(transitions);
    expect(ways).toHaveLength(5);
    expect(ways[0]).toEqual({ one: "attic", other: "bath", rate: 0.9 });
  });

  it("lies the same every time, within its square", () => {
    const one = placed(rooms, waysOf(transitions));
    expect(one).toEqual(placed(rooms, waysOf(transitions)));
    for (const { x, y } of one.values()) {
      expect(Math.min(x, y)).toBeGreaterThanOrEqual(0);
      expect(Math.max(x, y)).toBeLessThanOrEqual(1);
    }
  });

  it("draws rooms with a way between them nearer to each other", () => {
    const points = placed(rooms, waysOf(transitions));
    const apart = (one: string, other: string) => {
      const [a, b] = [points.get(one), points.get(other)];
      return a && b ? Math.hypot(a.x - b.x, a.y - b.y) : NaN;
    };
    expect(apart("attic", "bath")).toBeLessThan(apart("attic", "kitchen"));
    expect(apart("den", "hall")).toBeLessThan(apart("bath", "hall"));
  });

  it("has a place for a single room, and for none", () => {
    expect(placed(["hall"], []).get("hall")).toEqual({ x: 0.5, y: 0.5 });
    expect(placed([], []).size).toBe(0);
  });
});

it("robots of a room do not stand on each other", () => {
  const points = around(40, 30, 12);
  points.forEach((one, at) => {
    for (const other of points.slice(at + 1)) {
      expect(Math.hypot(one.x - other.x, one.y - other.y)).toBeGreaterThan(8);
    }
  });
});
