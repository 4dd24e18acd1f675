import { text as common } from "../src/texts/common";
import { text } from "../src/texts/live";
import { text as tries } from "../src/texts/try";
import { Foreign } from "./support/foreign";
import { framesOf, OTHER_ROOM, ROOM } from "./support/frames";
import { expect, test } from "./support/test";

test("a service that goes away is told, and the page finds it again", async ({ page, service }) => {
  const [frame = ""] = await framesOf(ROOM, "cloudy2");
  await service.recognize("wall-e", frame);
  // What is opened for the first time is not there without a service.
  await page.goto("#/models");
  await expect(page.getByRole("heading", { name: "lab", exact: true })).toBeVisible();
  await page.goto("#/live");
  const state = page.getByRole("status").filter({ hasText: /./ });
  await expect(state.getByText(text.feed.open, { exact: true })).toBeVisible();
  await service.stop("SIGKILL");
  await expect(state.getByText(text.feed.broken)).toBeVisible();
  // What was seen last stays in view.
  await expect(page.getByRole("article", { name: "wall-e" })).toBeVisible();
  await page.getByRole("link", { name: common.models }).click();
  await expect(page.getByText(common.unreachableDetail).first()).toBeVisible();
  await service.run();
  await page.getByRole("button", { name: common.retry }).first().click();
  await expect(page.getByRole("heading", { name: "lab", exact: true })).toBeVisible();
  await page.getByRole("link", { name: common.live, exact: true }).click();
  await expect(state.getByText(text.feed.open, { exact: true })).toBeVisible({ timeout: 20_000 });
});

for (const [way, milliseconds] of [
  ["forth", 3 * 3_600_000],
  ["back", -3 * 3_600_000],
] as const) {
  test(`a clock that jumps ${way} leaves ribbons whole`, async ({ page, service }) => {
    const [here = ""] = await framesOf(ROOM, "cloudy2");
    const [there = ""] = await framesOf(OTHER_ROOM, "cloudy2");
    await page.clock.install();
    await service.recognize("wall-e", here);
    await page.goto("#/live");
    const robot = page.getByRole("article", { name: "wall-e" });
    const ribbon = robot.locator(".ribbon");
    await expect(ribbon.locator("rect")).not.toHaveCount(0);
    await page.clock.setSystemTime(Date.now() + milliseconds);
    await service.recognize("wall-e", there);
    await expect(robot.locator(".verdict-room")).toHaveText(OTHER_ROOM);
    await expect(ribbon).toHaveAttribute("aria-label", text.ribbonOf(10, `${OTHER_ROOM}, ${ROOM}`));
    const lies = await ribbon.locator("rect").evaluateAll((parts) =>
      parts.map((part) => {
        const x = Number(part.getAttribute("x"));
        return x >= 0 && x <= 1000 && x + Number(part.getAttribute("width")) <= 1001;
      }),
    );
    expect(lies.length).toBeGreaterThan(0);
    expect(lies).not.toContain(false);
  });
}

test("the page works under the prefix of a proxy", async ({ page, service }) => {
  const [frame = ""] = await framesOf(ROOM, "cloudy2");
  await service.recognize("wall-e", frame);
  const proxy = await Foreign.proxy(service.url, "/robots/lab");
  const outside: string[] = [];
  page.on("request", (request) => {
    const { url } = { url: request.url() };
    if (url.startsWith("http") && !url.startsWith(`${proxy.url}/robots/lab/`)) outside.push(url);
  });
  await page.goto(`${proxy.url}/robots/lab/#/live`);
  const robot = page.getByRole("article", { name: "wall-e" });
  await expect(robot.getByRole("img", { name: text.frameOf("wall-e") })).toBeVisible();
  await page.getByRole("link", { name: common.try, exact: true }).click();
  await page.locator("input[type=file]").setInputFiles(frame);
  const answer = page.getByRole("region", { name: tries.answer });
  await expect(answer.locator(".verdict-room")).toHaveText(ROOM);
  expect(outside).toEqual([]);
  await proxy.close();
});

test("an address that is not there leads to Live", async ({ page }) => {
  await page.goto("#/nowhere/at/all");
  await expect(page.getByRole("heading", { name: text.title, level: 1 })).toBeVisible();
  await page.goto("#/live/no-such-robot");
  await expect(page.getByRole("heading", { name: text.notThere("no-such-robot") })).toBeVisible();
});
