import { rm } from "node:fs/promises";
import { join } from "node:path";
import type { Page } from "@playwright/test";
import { text as common } from "../src/texts/common";
import { text } from "../src/texts/teach";
import { layOut, removeFolder, temporaryFolder } from "./support/folders";
import { framesOf, OTHER_ROOM, ROOM } from "./support/frames";
import { expect, test } from "./support/test";

const rooms = (page: Page) => page.getByRole("navigation", { name: text.roomsLabel });
const room = (page: Page, name: string) => rooms(page).getByRole("button", { name });
const tiles = (page: Page) => page.getByRole("listbox").getByRole("option");
const undo = (page: Page) => page.getByRole("button", { name: common.undo });

test("a set is created, and a folder of rooms comes into it", async ({ page }) => {
  const [one = "", two = ""] = await framesOf(ROOM, "cloudy1");
  const [other = ""] = await framesOf(OTHER_ROOM, "cloudy1");
  const folder = await temporaryFolder();
  await layOut(folder, {
    "printer/monday/1.jpeg": one,
    "printer/tuesday/2.jpeg": two,
    "hall/3.jpeg": other,
    "hall/copy.jpeg": other,
  });
  await page.goto("#/teach");
  await page.getByRole("button", { name: text.newSet }).click();
  await page.getByLabel(text.setName).fill("no/name");
  await page.getByRole("button", { name: text.create }).click();
  await expect(page.getByText(text.setNameWrong)).toBeVisible();
  await page.getByLabel(text.setName).fill("home");
  await page.getByRole("button", { name: text.create }).click();

  await expect(page.getByRole("heading", { name: text.emptySet })).toBeVisible();
  await page.getByRole("button", { name: text.addPictures }).click();
  await page.locator("input[type=file][webkitdirectory]").setInputFiles(folder);
  await page.getByRole("button", { name: text.uploadStart(4) }).click();
  const dialog = page.getByRole("dialog");
  await expect(dialog.getByText(text.uploadAdded(3))).toBeVisible();
  await expect(dialog.getByText(text.uploadCopies(1))).toBeVisible();
  await dialog.getByRole("button", { name: text.done }).click();
  await expect(room(page, "printer")).toContainText("2");
  await expect(room(page, "hall")).toContainText("1");
  await expect(tiles(page)).toHaveCount(3);
  await removeFolder(folder);
});

test.describe("a set that is there", () => {
  test.beforeEach(async ({ page, service }) => {
    const printer = (await framesOf(ROOM, "cloudy1")).slice(0, 6);
    const corridor = (await framesOf(OTHER_ROOM, "cloudy1")).slice(0, 4);
    await service.makeSet("home", [...printer, ...corridor]);
    await page.goto("#/teach/home");
    await expect(tiles(page)).toHaveCount(10);
  });

  test("rooms are renamed, put together, and parted again", async ({ page }) => {
    await room(page, ROOM).click();
    await page.getByRole("button", { name: text.renameRoom }).click();
    await page.getByLabel(text.newName).fill("copies");
    await page.getByRole("button", { name: text.rename, exact: true }).click();
    await expect(room(page, "copies")).toContainText("6");

    await page.getByRole("button", { name: text.renameRoom }).click();
    await page.getByLabel(text.newName).fill(OTHER_ROOM);
    await expect(page.getByText(text.mergeHint(OTHER_ROOM))).toBeVisible();
    await page.getByRole("button", { name: text.rename, exact: true }).click();
    await expect(room(page, OTHER_ROOM)).toContainText("10");
    await expect(room(page, "copies")).toHaveCount(0);

    await undo(page).last().click();
    await expect(room(page, "copies")).toContainText("6");
    await page.getByRole("tab", { name: text.tabs.changes }).click();
    await expect(page.getByText(text.undone, { exact: true })).toHaveCount(1);
    await page.getByRole("tabpanel").getByRole("button", { name: common.undo }).click();
    await page.getByRole("tab", { name: text.tabs.frames }).click();
    await expect(room(page, ROOM)).toContainText("6");
  });

  test("many frames are moved at once with the mouse", async ({ page }) => {
    await room(page, ROOM).click();
    await expect(tiles(page)).toHaveCount(6);
    await tiles(page).nth(0).click();
    await tiles(page)
      .nth(3)
      .click({ modifiers: ["Shift"] });
    await tiles(page)
      .nth(1)
      .click({ modifiers: ["ControlOrMeta"] });
    await expect(page.getByText(text.selected(3), { exact: true })).toBeVisible();
    await page.getByRole("button", { name: text.move }).click();
    await page.getByRole("radio", { name: OTHER_ROOM }).check();
    await page.getByRole("button", { name: text.moveHere, exact: true }).click();
    await expect(room(page, ROOM)).toContainText("3");
    await expect(room(page, OTHER_ROOM)).toContainText("7");
    await undo(page).last().click();
    await expect(room(page, ROOM)).toContainText("6");
  });

  test("many frames are dragged onto a room", async ({ page }) => {
    await room(page, ROOM).click();
    await expect(tiles(page)).toHaveCount(6);
    await tiles(page).nth(0).click();
    await tiles(page)
      .nth(1)
      .click({ modifiers: ["Shift"] });
    await tiles(page).nth(1).dragTo(room(page, OTHER_ROOM));
    await expect(room(page, OTHER_ROOM)).toContainText("6");
    await expect(room(page, ROOM)).toContainText("4");
  });

  test("many frames are moved and removed with keys alone", async ({ page }) => {
    await page.getByRole("listbox").focus();
    await page.keyboard.press("ControlOrMeta+a");
    await expect(page.getByText(text.selected(10), { exact: true })).toBeVisible();
    await page.keyboard.press("Home");
    await page.keyboard.press("Shift+ArrowRight");
    await expect(page.getByText(text.selected(2), { exact: true })).toBeVisible();
    await page.keyboard.press("m");
    await page.getByRole("radio", { name: text.moveNew }).check();
    await page.getByLabel(text.roomName).fill("stairs");
    await page.keyboard.press("Enter");
    await expect(room(page, "stairs")).toContainText("2");
    await page.getByRole("listbox").focus();
    await page.keyboard.press("End");
    await page.keyboard.press("Delete");
    await expect(room(page, text.allRooms)).toContainText("9");
  });

  test("a set that vanishes is told, and the page goes on", async ({ page, service }) => {
    await rm(join(service.data, "sets/home"), { recursive: true });
    await page.getByRole("listbox").focus();
    await page.keyboard.press("Delete");
    await expect(page.getByRole("alert").first()).toContainText(/home/);
    await page.getByRole("link", { name: text.back }).click();
    await expect(page.getByRole("heading", { name: text.noSets })).toBeVisible();
  });
});

test("the check finds a picture that is in two rooms, and it is put right", async ({
  page,
  service,
}) => {
  test.slow();
  const [one = "", two = ""] = await framesOf(ROOM, "cloudy1");
  await layOut(join(service.data, "sets/odd"), {
    "printer/monday/1.jpeg": one,
    "printer/monday/2.jpeg": two,
    "hall/monday/copy.jpeg": one,
  });
  await page.goto("#/teach/odd/check");
  await page.getByRole("button", { name: text.checkStart }).click();
  // The process that looks for it gives way to all others.
  await expect(page.getByText(/^Checked .+: 3 frames\./)).toBeVisible({ timeout: 120_000 });
  const finding = page.getByRole("listitem").filter({ hasText: "also in printer" });
  await expect(finding.getByRole("img")).toHaveCount(2);
  await finding.getByRole("button", { name: text.remove }).click();
  await expect(finding).toHaveCount(0);
  const { rooms } = await service.call<{ rooms: { name: string }[] }>("GET", "sets/odd");
  expect(rooms.map(({ name }) => name)).toEqual(["printer"]);
});

test("names with markup are shown as they are, and run nothing", async ({ page, service }) => {
  const [one = "", two = ""] = await framesOf(ROOM, "cloudy1");
  const attack = "<img src=x onerror=document.title='hacked'>";
  await layOut(join(service.data, "sets/odd"), {
    [`<b>hall/${attack}/"${attack}.jpeg`]: one,
    [`<b>hall/monday/${attack}.txt`]: two,
    [`${attack}/monday/2.jpeg`]: two,
  });
  await page.goto("#/teach/odd");
  await expect(tiles(page)).toHaveCount(2);
  await expect(room(page, attack)).toBeVisible();
  await room(page, "<b>hall").click();
  await expect(page.getByLabel(text.drive).locator("option")).toContainText([attack]);
  await expect(tiles(page)).toHaveCount(1);
  await tiles(page).first().dblclick();
  const viewer = page.getByRole("dialog");
  await expect(viewer.getByRole("heading")).toContainText(attack);
  // The picture itself comes too, by an address that holds its name.
  await expect
    .poll(() => viewer.getByRole("img").evaluate((image: HTMLImageElement) => image.naturalWidth))
    .toBe(640);
  await viewer.getByRole("button", { name: common.close }).click();
  await page.getByRole("button", { name: text.addPictures }).click();
  await page.locator("input[type=file][multiple]:not([webkitdirectory])").setInputFiles({
    name: `${attack}.jpeg`,
    mimeType: "image/jpeg",
    buffer: Buffer.from("no picture"),
  });
  await page.getByLabel(text.uploadInto, { exact: true }).fill("hall");
  await page.getByRole("button", { name: text.uploadStart(1) }).click();
  await expect(page.getByRole("dialog").getByText(attack)).toBeVisible();
  await expect(page.locator("img[src=x]")).toHaveCount(0);
  await expect(page).not.toHaveTitle("hacked");
});
