import { expect, it } from "vitest";
import { Rate } from "./rate";

it("counts what happened lately", () => {
  const rate = new Rate(1000);
  expect(rate.perSecond()).toBe(0);
  for (let at = 0; at <= 4000; at += 250) rate.add(at, at < 3000 ? 100 : 20);
  expect(rate.perSecond()).toBe(4);
  expect(rate.meanMs()).toBe(20);
});
