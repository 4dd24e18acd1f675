import { readFile } from "node:fs/promises";
import type { Page } from "@playwright/test";
import type { InboxFrame } from "../src/api/inbox";
import { text as common } from "../src/texts/common";
import { text as frames } from "../src/texts/frames";
import { text } from "../src/texts/inbox";
import { framesOf, OTHER_ROOM, ROOM } from "./support/frames";
import type { Service } from "./support/service";
import { expect, test } from "./support/test";

const tiles = (page: Page) => page.getByRole("listbox").getByRole("option");
const bar = (page: Page) => page.getByRole("group", { name: text.labelBar });

/** Says of so many frames of another room than those of the data set that their answers were wrong. */
async function fill(service: Service, n: number): Promise<void> {
  await service.makeSet("home", await framesOf(ROOM, "cloudy1"));
  for (const frame of (await framesOf(OTHER_ROOM, "cloudy1")).slice(0, n)) {
    await service.call("POST", "inbox?robot=wall-e", await readFile(frame));
  }
}

interface SetSummary {
  rooms: { name: string; frames: number }[];
}

const roomsOf = async (service: Service) =>
  (await service.call<SetSummary>("GET", "sets/home")).rooms.map(({ name }) => name);

test("what is to be kept is chosen, and frames come from a robot", async ({ page, service }) => {
  await page.goto("#/inbox");
  await expect(page.getByText(text.off)).toBeVisible();
  await page.getByRole("button", { name: text.switchOn }).click();
  await page.getByRole("radio", { name: text.ruleSome }).check();
  await page.getByRole("button", { name: text.save }).click();
  await expect(page.getByText(text.ruleNeedsSome)).toBeVisible();
  await page.getByLabel(text.ruleRobots, { exact: true }).fill("wall-e");
  await page.getByLabel(text.ruleEvery).fill("0");
  await page.getByLabel(text.ruleProbability).fill("100");
  await page.getByRole("button", { name: text.save }).click();
  await expect(page.getByText(text.saved)).toBeVisible();

  const drive = (await framesOf(OTHER_ROOM, "cloudy2")).slice(0, 3);
  for (const frame of drive) {
    await service.recognize("wall-e", frame);
    await service.recognize("eve", frame);
  }
  await page.getByRole("tab", { name: text.tabs.frames }).click();
  await expect
    .poll(async () => (await service.call<{ total: number }>("GET", "inbox")).total)
    .toBe(3);
  await page.reload();
  await expect(tiles(page)).toHaveCount(3);
  await expect(page.getByRole("link", { name: `${common.inbox} 3` })).toBeVisible();
  const panel = page.getByRole("complementary", { name: text.panel });
  await expect(panel).toContainText("wall-e");
  await expect(panel).toContainText(text.reasons.low);
});

test("twenty frames are labeled at once, and that is undone", async ({ page, service }) => {
  await fill(service, 20);
  await page.goto("#/inbox");
  await expect(tiles(page).first()).toBeVisible();
  await page.getByRole("listbox").focus();
  await page.keyboard.press("ControlOrMeta+a");
  await expect(bar(page).getByText(text.selected(20))).toBeVisible();
  // The key is that of a room, once these are loaded.
  await expect(bar(page).getByRole("button", { name: ROOM })).toBeVisible();
  await page.keyboard.press("1");
  await expect(page.getByText(text.labeled(20, ROOM, "home"))).toBeVisible();
  await expect(page.getByRole("heading", { name: text.none })).toBeVisible();
  const n = (await framesOf(ROOM, "cloudy1")).length;
  const { rooms } = await service.call<SetSummary>("GET", "sets/home");
  expect(rooms).toMatchObject([{ name: ROOM, frames: n + 20 }]);

  await page.getByRole("button", { name: common.undo }).click();
  await expect(page.getByRole("listbox", { name: text.gridLabel(20) })).toBeVisible();
});

test("frames go elsewhere, into a new room, and away", async ({ page, service }) => {
  await fill(service, 3);
  await page.goto("#/inbox");
  await expect(tiles(page)).toHaveCount(3);
  await page.getByRole("listbox").focus();
  await page.keyboard.press("e");
  await expect(tiles(page)).toHaveCount(2);
  await bar(page).getByRole("button", { name: text.newRoom }).click();
  await page.getByLabel(text.roomName).fill("stairs");
  await page.getByRole("button", { name: text.label, exact: true }).click();
  await expect(tiles(page)).toHaveCount(1);
  await page.getByRole("listbox").focus();
  await page.keyboard.press("Delete");
  const question = page.getByRole("dialog", { name: text.discardTitle(1) });
  await question.getByRole("button", { name: text.discard }).click();
  await expect(page.getByRole("heading", { name: text.none })).toBeVisible();
  expect((await roomsOf(service)).sort()).toEqual([common.elsewhere, ROOM, "stairs"].sort());
});

test("of two people who label the same frame the second is told", async ({
  page,
  service,
  browser,
  baseURL,
}) => {
  await fill(service, 1);
  const other = await browser.newPage({ baseURL });
  for (const person of [page, other]) {
    await person.goto("#/inbox");
    await expect(tiles(person)).toHaveCount(1);
  }
  await bar(page).getByRole("button", { name: ROOM }).click();
  await expect(page.getByText(text.labeled(1, ROOM, "home"))).toBeVisible();
  await bar(other).getByRole("button", { name: common.elsewhere }).click();
  const told = other.getByRole("dialog", { name: text.conflictsTitle(1) });
  await expect(told).toContainText(ROOM);
  await told.getByRole("button", { name: text.showLabeled }).click();
  await expect(tiles(other)).toHaveCount(1);
  await expect(tiles(other).first()).toHaveAccessibleName(text.labeledAs(ROOM));
  expect(await roomsOf(service)).toEqual([ROOM]);
  await other.close();
});

test("ten thousand frames can be gone through", async ({ page, service }) => {
  await fill(service, 1);
  const { frames: kept } = await service.call<{ frames: InboxFrame[] }>("GET", "inbox");
  const all = Array.from({ length: 10_000 }, (_, at) => ({ ...kept[0], id: at + 1 }));
  // The service is asked for pages of them as it would be.
  await page.route("**/v1/inbox?**", async (route) => {
    const query = new URL(route.request().url()).searchParams;
    const from = Number(query.get("after") ?? 0);
    const to = from + Number(query.get("limit") ?? 100);
    const next = to < all.length ? to : undefined;
    const page = { total: all.length, open: all.length, frames: all.slice(from, to), next };
    await route.fulfill({ json: page });
  });
  await page.route("**/v1/inbox/*/picture**", (route) =>
    route.fulfill({ path: "src/favicon.svg", contentType: "image/svg+xml" }),
  );
  await page.goto("#/inbox");
  await expect(page.getByRole("listbox", { name: text.gridLabel(10_000) })).toBeVisible();
  const list = page.getByRole("listbox");
  await list.focus();
  await page.keyboard.press("End");
  // Few of them are in the document at any time.
  expect(await tiles(page).count()).toBeLessThan(200);
  await list.evaluate((element) => element.scrollTo(0, element.scrollHeight));
  await expect
    .poll(() => tiles(page).last().getAttribute("aria-posinset"), { timeout: 30_000 })
    .toBe("10000");
  expect(await tiles(page).count()).toBeLessThan(200);
  await bar(page).getByRole("button", { name: text.selectAll }).click();
  await expect(bar(page).getByText(text.selected(10_000))).toBeVisible();
});

test("a frame is looked at closely, and so are those beside it", async ({ page, service }) => {
  await fill(service, 2);
  await page.goto("#/inbox");
  await tiles(page).first().dblclick();
  const viewer = page.getByRole("dialog");
  await expect(viewer.getByText(frames.position(1, 2))).toBeVisible();
  await page.keyboard.press("ArrowRight");
  await expect(viewer.getByText(frames.position(2, 2))).toBeVisible();
});
