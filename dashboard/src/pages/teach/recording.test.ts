import { describe, expect, it } from "vitest";
import {
  EMPTY,
  ENOUGH,
  PLENTY,
  considered,
  driveName,
  progress,
  type Recording,
} from "./recording";
import type { View } from "./view";

/** A view in a direction: those of other directions have nothing in common. */
function view(direction: number, changes: Partial<View> = {}): View {
  const thumbnail = new Float32Array(192);
  thumbnail[direction] = 1;
  return { brightness: 120, sharpness: 100, thumbnail, ...changes };
}

const after = (views: View[], from: Recording = EMPTY) => views.reduce<Recording>(considered, from);

describe("a recording", () => {
  it("takes each view once, also after others", () => {
    const recording = after([view(0), view(0), view(1), view(0)]);
    expect(recording.taken).toHaveLength(2);
    expect(recording.last).toBe("same");
  });

  it("takes no dark frames", () => {
    expect(after([view(0, { brightness: 5 })])).toMatchObject({ taken: [], last: "dark" });
  });

  it("takes no frames that are blurred for this camera and room", () => {
    const soft = [0, 1, 2].map((direction) => view(direction, { sharpness: 8 }));
    expect(after(soft).taken).toHaveLength(3);
    const recording = after([view(0), view(1), view(2), view(3, { sharpness: 30 })]);
    expect(recording).toMatchObject({ last: "blurred" });
    expect(recording.taken).toHaveLength(3);
  });

  it("goes on where the light and with it the sharpness changes", () => {
    const dim = Array.from({ length: 40 }, (_, index) => view(100 + index, { sharpness: 30 }));
    expect(after(dim, after([view(0), view(1)])).taken.length).toBeGreaterThan(20);
  });

  it("ends where there are plenty", () => {
    const recording = after(Array.from({ length: 150 }, (_, index) => view(index)));
    expect(recording.taken).toHaveLength(PLENTY);
    expect(recording.last).toBe("plenty");
  });

  it("is enough at forty", () => {
    expect(progress(0)).toBe(0);
    expect(progress(ENOUGH / 2)).toBe(0.5);
    expect(progress(ENOUGH)).toBe(1);
    expect(progress(PLENTY)).toBe(1);
  });
});

it("a drive is named by day and time", () => {
  expect(driveName(new Date(2025, 0, 7, 9, 4, 5))).toBe("2025-01-07-0904-05");
});
