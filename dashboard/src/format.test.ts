import { expect, it } from "vitest";
import { bytes, duration, milliseconds, percent, plural } from "./format";

const plain = (text: string) => text.replaceAll("\u00a0", " ");

it("says shares in percent, and never all of what is not all", () => {
  expect([0, 0.004, 0.824, 0.996, 1, undefined].map(percent).map(plain)).toEqual([
    "0 %",
    "< 1 %",
    "82 %",
    "> 99 %",
    "100 %",
    "–",
  ]);
});

it("says durations in their two largest units", () => {
  expect([0.4, 59, 200, 3600, 90_061].map(duration).map(plain)).toEqual([
    "0 s",
    "59 s",
    "3 min 20 s",
    "1 h",
    "1 d 1 h",
  ]);
});

it("keeps numbers short", () => {
  expect([0.26, 9.94, 120.4, 12_345].map(milliseconds).map(plain)).toEqual([
    "0.3 ms",
    "9.9 ms",
    "120 ms",
    "12.3 s",
  ]);
  expect([900, 1536, 5e8].map(bytes).map(plain)).toEqual(["900 B", "1.5 KiB", "477 MiB"]);
  expect([plural(1, "frame"), plural(1200, "frame")]).toEqual(["1 frame", "1,200 frames"]);
});
