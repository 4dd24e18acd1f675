import type { Page } from "@playwright/test";
import { text as auditText } from "../src/texts/audit";
import { text as common } from "../src/texts/common";
import { text as models } from "../src/texts/models";
import { text as teach } from "../src/texts/teach";
import { text } from "../src/texts/service";
import { text as tries } from "../src/texts/try";
import { framesOf, MODEL, ROOM } from "./support/frames";
import { expect, test } from "./support/test";

const dialog = (page: Page, name: string) => page.getByRole("dialog", { name });

async function signIn(page: Page, key: string): Promise<void> {
  const asked = dialog(page, common.signInTitle);
  await asked.getByLabel(common.key).fill(key);
  await asked.getByRole("button", { name: common.signIn, exact: true }).click();
}

test("charts and tables tell how the service does", async ({ page, service }) => {
  const [frame = ""] = await framesOf(ROOM, "cloudy2");
  await page.goto("#/service");
  await expect(page.getByRole("heading", { name: text.noHistory })).toBeVisible();
  await service.recognize("wall-e", frame);
  const throughput = page.getByRole("img", {
    name: new RegExp(`^${text.charts.throughput}\\. Now`),
  });
  // The first point comes after ten seconds.
  await expect(throughput).toBeVisible({ timeout: 30_000 });
  await expect(throughput.locator("canvas")).toBeVisible();
  await expect(page.getByRole("group", { name: text.models })).toContainText(`${MODEL}/1`);
  await expect(page.getByRole("group", { name: text.connected })).toContainText("wall-e");
});

test("the first key of an open service is made, and then keys are asked for", async ({
  page,
  browser,
  baseURL,
}) => {
  await page.goto("#/service/keys");
  await expect(page.getByText(text.keysOpen)).toBeVisible();
  await page.getByRole("button", { name: text.makeFirstKey }).click();
  const making = dialog(page, text.makeFirstKey);
  await making.getByRole("button", { name: text.makeKey }).click();
  await expect(making.getByText(text.keyNameMissing)).toBeVisible();
  await making.getByLabel(text.keyName).fill("anna");
  await making.getByRole("button", { name: text.makeKey }).click();
  const told = dialog(page, text.told);
  const key = await told.getByRole("textbox").inputValue();
  expect(key).toMatch(/^rs_/);
  await told.getByRole("button", { name: text.toldDone }).click();
  await expect(page.getByText(common.signedInAs("anna", "admin"))).toBeVisible();

  const other = await browser.newPage({ baseURL });
  await other.goto("#/models");
  await signIn(other, "rs_wrong");
  await expect(other.locator(".wrong")).toBeVisible();
  await signIn(other, key);
  await expect(other.getByRole("heading", { name: models.title, level: 1 })).toBeVisible();
  await other.getByRole("button", { name: common.signOut }).click();
  await expect(dialog(other, common.signInTitle)).toBeVisible();
  await other.close();
});

test("a viewer sees everything and changes nothing", async ({ page, service }) => {
  const [frame = ""] = await framesOf(ROOM, "cloudy2");
  const { viewer } = await service.makeKeys();
  await service.makeSet("home", [frame]);
  await page.goto("#/teach/home");
  await signIn(page, viewer);
  await expect(page.getByText(common.signedInAs("viewer-key", "viewer"))).toBeVisible();
  await expect(page.getByRole("option")).toHaveCount(1);
  // What is not allowed stays in reach, and says why.
  await page.getByRole("button", { name: teach.addPictures }).click({ force: true });
  await expect(page.locator(".toast").last()).toContainText(common.needsRole("admin"));
  await expect(page.getByRole("dialog")).toHaveCount(0);
  await page.getByRole("listbox").focus();
  await page.keyboard.press("Delete");
  await page.goto("#/models");
  await page.getByRole("button", { name: models.train }).click({ force: true });
  await expect(page.getByRole("dialog")).toHaveCount(0);
  await page.goto("#/service/keys");
  await expect(page.getByRole("heading", { name: text.keysRefused })).toBeVisible();
  await page.goto("#/try");
  await page.getByRole("button", { name: tries.choose }).click({ force: true });
  await expect(page.locator(".toast").last()).toContainText(common.needsRole("robot"));
  const { rooms } = await service.call<{ rooms: unknown[] }>("GET", "sets/home");
  expect(rooms).toHaveLength(1);
});

test("a robot's key shows frames to the model, and sees nothing else", async ({
  page,
  service,
}) => {
  const [frame = ""] = await framesOf(ROOM, "cloudy2");
  const { robot } = await service.makeKeys();
  await page.goto("#/try");
  await signIn(page, robot);
  await page.locator("input[type=file]").setInputFiles(frame);
  const answer = page.getByRole("region", { name: tries.answer });
  await expect(answer.locator(".verdict-room")).toHaveText(ROOM);
  await page.goto("#/teach");
  await expect(page.getByRole("alert")).toBeVisible();
});

test("whoever's key is revoked is asked to sign in, and goes on where they were", async ({
  page,
  service,
}) => {
  const { viewer, admin } = await service.makeKeys();
  await page.goto("#/teach");
  await signIn(page, viewer);
  await expect(page.getByRole("heading", { name: teach.noSets })).toBeVisible();
  await service.call("DELETE", "keys/viewer-key");
  await page.getByRole("link", { name: common.models }).click();
  await expect(page.getByText(common.signInAgain)).toBeVisible();
  await signIn(page, admin);
  await expect(page.getByRole("heading", { name: MODEL, exact: true })).toBeVisible();

  await page.goto("#/service/keys");
  const row = page.getByRole("row").filter({ hasText: "robot-key" });
  await row.getByRole("button", { name: text.revoke }).click();
  const question = dialog(page, text.revokeTitle("robot-key"));
  await question.getByRole("button", { name: text.revoke }).click();
  await expect(row).toHaveCount(0);
  await page.getByRole("tab", { name: auditText.title }).click();
  const audit = page.getByRole("group", { name: auditText.title });
  const revoked = audit.getByRole("row").filter({ hasText: "robot-key" });
  await expect(revoked.first()).toContainText(auditText.actions.key_revoked ?? "");
  await expect(revoked.first()).toContainText("admin-key");
});

test.describe("without a data directory", () => {
  test.use({ serviceOptions: { hasData: false } });

  test("the page shows models, and says what is missing", async ({ page }) => {
    await page.goto("#/models");
    await expect(page.getByRole("heading", { name: MODEL, exact: true })).toBeVisible();
    await page.goto("#/teach");
    await expect(page.getByRole("alert")).toContainText(/data/);
    await page.goto("#/service/audit");
    await expect(page.getByText(common.noData)).toBeVisible();
  });
});
