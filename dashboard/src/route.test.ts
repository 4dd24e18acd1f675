import { beforeAll, expect, it, vi } from "vitest";

// A browser's address, of which the module reads the fragment.
vi.stubGlobal("location", { hash: "" });
vi.stubGlobal("addEventListener", () => undefined);
let route: typeof import("./route");
beforeAll(async () => {
  route = await import("./route");
});

it("finds the page and the rest of an address, whatever names hold", () => {
  for (const name of ["wall-e", "a/b #?%", "<b>"]) {
    expect(route.parseRoute(route.href("live", name))).toEqual({ page: "live", rest: [name] });
  }
});

it("leads to Live from what is not known or broken", () => {
  expect(route.parseRoute("#/nothing/here")).toEqual({ page: "live", rest: [] });
  expect(route.parseRoute("#/live/%E0%A4%A")).toEqual({ page: "live", rest: ["%E0%A4%A"] });
  expect(route.parseRoute("#/code/abc")).toEqual({ page: "code", rest: ["abc"] });
});
