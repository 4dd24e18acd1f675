import { expect, it } from "vitest";
import { Pace } from "./pace";

it("draws more seldom while the browser is slow, and as before when it is not", () => {
  const pace = new Pace();
  const wait = (ms: number) => Array.from({ length: 40 }, () => pace.waited(ms));
  wait(12);
  expect(pace.everyMs()).toBe(1000);
  wait(60);
  expect(pace.everyMs()).toBeGreaterThan(2500);
  wait(10_000);
  expect(pace.everyMs()).toBe(5000);
  wait(12);
  expect(pace.everyMs()).toBeLessThan(1500);
});
