import { expect, it } from "vitest";
import { ApiError } from "../../api/client";
import { judge } from "./judge";

const refused = (status: number, kind = "") =>
  judge(new ApiError(status, `/problems/${kind}`, "title", "detail")).then;

it("what passes by itself is tried again", () => {
  expect([0, 429, 500, 502].map((status) => refused(status))).toEqual(Array(4).fill("again"));
});

it("what a person must see to stops", () => {
  expect(refused(507, "disk-full")).toBe("stop");
  expect(refused(401)).toBe("stop");
  expect(refused(404)).toBe("stop");
  expect(refused(503, "no-data-directory")).toBe("stop");
  expect(judge(new Error("odd"))).toEqual({ then: "stop", reason: "odd" });
});

it("a picture that is none does not hold up the others", () => {
  expect(refused(415)).toBe("drop");
  expect(refused(413)).toBe("drop");
});
