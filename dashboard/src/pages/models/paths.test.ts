import { expect, it } from "vitest";

// The route is read from the address of the page when it is loaded.
Object.assign(globalThis, { location: { hash: "" }, addEventListener: () => undefined });
const { parsed, written } = await import("./paths");

it("what is compared is read as it is written", () => {
  const version = { kind: "version", model: "home-2.b", version: 3 } as const;
  const training = { kind: "training", id: 12 } as const;
  expect(written(version)).toBe("home-2.b@3");
  expect(parsed(written(version))).toEqual(version);
  expect(parsed(written(training))).toEqual(training);
});

it("anything else is nothing", () => {
  for (const text of [undefined, "", "home", "home@", "~x", "@3", "~1@2"]) {
    expect(parsed(text)).toBeUndefined();
  }
});
