import { readFile } from "node:fs/promises";
import { basename } from "node:path";
import { text as common } from "../src/texts/common";
import { text as inbox } from "../src/texts/inbox";
import { text } from "../src/texts/try";
import { cameraOf } from "./support/browser";
import { dropOn } from "./support/drop";
import { framesOf, OTHER_ROOM, ROOM } from "./support/frames";
import { expect, test } from "./support/test";

test.use({ launchOptions: cameraOf("room") });

test("a dropped picture is answered and explained", async ({ page }) => {
  const [frame = ""] = await framesOf(ROOM, "cloudy2");
  await page.goto("#/try");
  await dropOn(page.locator(".drop-zone"), basename(frame), await readFile(frame));
  const answer = page.getByRole("region", { name: text.answer });
  await expect(answer.locator(".verdict-room")).toHaveText(ROOM);
  await expect(answer).toContainText("lab/1");
  const evidence = page.getByRole("img", { name: common.evidence });
  await expect(evidence.locator(".for")).not.toHaveCount(0);
  await expect(page.getByRole("region", { name: common.nearest })).toContainText(ROOM);
});

test("what is no picture is refused in words", async ({ page }) => {
  await page.goto("#/try");
  await dropOn(page.locator(".drop-zone"), "frame.jpg", Buffer.from("no picture"));
  await expect(page.getByRole("alert")).toContainText(/picture|image|format/i);
  await expect(page.getByRole("region", { name: text.answer })).toHaveCount(0);
});

test("an answer that is called wrong waits in the inbox", async ({ page, service }) => {
  const [frame = "", other = ""] = await framesOf(ROOM, "cloudy2");
  await service.makeSet("home", [other]);
  await page.goto("#/try");
  await page.locator("input[type=file]").setInputFiles(frame);
  await page.getByRole("button", { name: common.wrong, exact: true }).click();
  const dialog = page.getByRole("dialog", { name: common.wrongTitle });
  await dialog.getByRole("radio", { name: OTHER_ROOM }).check();
  await dialog.getByRole("button", { name: common.wrongSend }).click();
  await expect(page.getByText(common.wrongSent)).toBeVisible();

  await page.getByRole("link", { name: common.inbox }).click();
  const panel = page.getByRole("complementary", { name: inbox.panel });
  await expect(panel).toContainText(inbox.reasons.wrong);
  await expect(panel).toContainText(inbox.said(OTHER_ROOM));
  await panel.getByRole("button", { name: inbox.labelSaid(OTHER_ROOM) }).click();
  await expect(page.getByText(inbox.labeled(1, OTHER_ROOM, "home"))).toBeVisible();
  const set = await service.call("GET", "sets/home");
  expect(set).toMatchObject({ rooms: [{ name: OTHER_ROOM }, { name: ROOM }] });
});

test("what the camera sees is answered as it goes", async ({ page }) => {
  await page.goto("#/try");
  await page.getByRole("tab", { name: text.camera }).click();
  await page.getByRole("button", { name: text.start }).click();
  const answer = page.getByRole("region", { name: text.answer });
  await expect(answer.locator(".verdict-room").first()).toHaveText(ROOM);
  await expect(answer).toContainText(/camera-[0-9a-f]{4}/);
  await page.getByLabel(text.explain).check();
  const evidence = page.getByRole("img", { name: common.evidence });
  await expect(evidence.locator(".for")).not.toHaveCount(0);
  await page.getByRole("button", { name: text.stop }).click();
  await expect(page.getByRole("button", { name: text.start })).toBeVisible();

  await page.getByRole("link", { name: common.live, exact: true }).click();
  await expect(page.getByRole("article", { name: /^camera-/ })).toBeVisible();
});
