import { join } from "node:path";
import AxeBuilder from "@axe-core/playwright";
import { test as base, expect, type Page } from "@playwright/test";
import { text as common } from "../src/texts/common";
import { text as teach } from "../src/texts/teach";
import { Lab } from "./support/lab";

/** They only look: one service is enough for all tests of a worker. */
const test = base.extend<object, { lab: Lab }>({
  lab: [
    // Playwright reads what a fixture takes from its first parameter.
    // eslint-disable-next-line no-empty-pattern -- it takes nothing
    async ({}, use) => {
      const lab = await Lab.open();
      await use(lab);
      await lab.close();
    },
    { scope: "worker", timeout: 120_000 },
  ],
  baseURL: async ({ lab }, use) => {
    await use(`${lab.service.url}/`);
  },
});

interface View {
  name: string;
  /** Where it is. */
  path: string;
  /** What is there once it has loaded. */
  shows: string;
  /** What is done there first. */
  open?: (page: Page) => Promise<void>;
}

const press = (name: string) => (page: Page) =>
  page.getByRole("button", { name, exact: true }).first().click();
const choose = (tab: string) => (page: Page) => page.getByRole("tab", { name: tab }).click();

const VIEWS: View[] = [
  { name: "live", path: "live", shows: ".robot-card img" },
  { name: "live-rooms", path: "live", shows: ".room-node", open: choose("Rooms") },
  { name: "live-map", path: "live", shows: ".positions .position", open: choose("Map") },
  { name: "live-robot", path: "live/robot-1", shows: ".robot-large img" },
  { name: "wrong", path: "live/robot-1", shows: "dialog img", open: press(common.wrong) },
  { name: "try", path: "try", shows: ".drop-zone" },
  { name: "try-camera", path: "try", shows: ".camera-start", open: choose("The camera") },
  { name: "teach", path: "teach", shows: ".set-card" },
  { name: "teach-set", path: "teach/home", shows: ".frame img" },
  { name: "teach-upload", path: "teach/home", shows: "dialog", open: press(teach.addPictures) },
  { name: "teach-train", path: "teach/home", shows: "dialog", open: press(teach.train) },
  { name: "teach-check", path: "teach/home/check", shows: ".tab-body" },
  { name: "teach-changes", path: "teach/home/changes", shows: ".table td" },
  { name: "teach-record", path: "teach/home/record", shows: ".record-form" },
  { name: "inbox", path: "inbox", shows: ".training-frames-list li" },
  { name: "inbox-rule", path: "inbox/rule", shows: ".form" },
  { name: "inbox-policy", path: "inbox/policy", shows: ".form" },
  { name: "models", path: "models", shows: ".version-actions" },
  { name: "models-trainings", path: "models/~trainings", shows: ".training" },
  { name: "models-training", path: "models/~trainings/1", shows: ".confusion" },
  { name: "models-version", path: "models/lab/2", shows: ".confusion" },
  { name: "models-compare", path: "models/~compare/lab@1/lab@2", shows: ".report" },
  { name: "service", path: "service", shows: ".chart canvas" },
  { name: "service-keys", path: "service/keys", shows: ".service-panel .button" },
  { name: "service-audit", path: "service/audit", shows: ".table td" },
  { name: "service-about", path: "service/about", shows: ".links" },
];

/** Whether pictures are taken too, which takes minutes. */
const TAKES_PICTURES = process.env.PICTURES === "1";
const WIDTHS = [390, 1280, 2560];
const NARROWEST = 360;

async function show(page: Page, view: View): Promise<void> {
  await page.goto(`#/${view.path}`);
  await expect(page.getByRole("heading", { level: 1 })).toBeVisible();
  await view.open?.(page);
  await expect(page.locator(view.shows).first()).toBeVisible({ timeout: 25_000 });
}

/** Whether all pictures have come that are in view; those of a model that was trained elsewhere never do. */
const arePicturesThere = () =>
  [...document.images].every((image) => {
    if (image.closest(".training-frames-list")) return true;
    const { top, bottom } = image.getBoundingClientRect();
    return image.complete || bottom < 0 || top > innerHeight;
  });

async function expectAccessible(page: Page): Promise<void> {
  const { violations } = await new AxeBuilder({ page }).analyze();
  const told = violations.map(({ id, nodes }) => `${id}: ${nodes.map(({ html }) => html).join()}`);
  expect(told).toEqual([]);
}

const sizeOf = (width: number) => ({
  width,
  height: width < 1000 ? 844 : Math.round(width * 0.6),
});

/** For people to look at: test-results/looks. */
async function takePictures(page: Page, view: View): Promise<void> {
  for (const colorScheme of ["light", "dark"] as const) {
    await page.emulateMedia({ colorScheme });
    for (const width of WIDTHS) {
      await page.setViewportSize(sizeOf(width));
      await expect.poll(() => page.evaluate(arePicturesThere)).toBe(true);
      const { outputDir } = test.info().project;
      const path = join(outputDir, "looks", `${view.name}-${width}-${colorScheme}.png`);
      await page.screenshot({ path, fullPage: width < 1000 });
    }
  }
}

for (const view of VIEWS) {
  test(`${view.name} is accessible and fits, in light and dark`, async ({ page }) => {
    await show(page, view);
    for (const [colorScheme, width] of [
      ["light", 1280],
      ["dark", 390],
    ] as const) {
      await page.emulateMedia({ colorScheme });
      await page.setViewportSize(sizeOf(width));
      await expect.poll(() => page.evaluate(arePicturesThere)).toBe(true);
      await expectAccessible(page);
    }
    if (TAKES_PICTURES) await takePictures(page, view);
    await page.setViewportSize({ width: NARROWEST, height: 640 });
    const { scrollWidth, clientWidth } = await page.evaluate(() => {
      const { scrollWidth, clientWidth } = document.documentElement;
      return { scrollWidth, clientWidth };
    });
    expect(scrollWidth, "nothing is scrolled sideways").toBeLessThanOrEqual(clientWidth);
  });
}

test("a data set is reached, and its frames are gone through, with keys alone", async ({
  page,
}) => {
  await page.goto("#/live");
  await expect(page.locator(".robot-card").first()).toBeVisible();
  /** Presses Tab until the focus is on something of that name. */
  const tabTo = async (name: string) => {
    for (let presses = 0; presses < 60; presses += 1) {
      await page.keyboard.press("Tab");
      const focused = page.locator(":focus");
      // After the last part of the page the browser has it.
      if ((await focused.count()) === 0) continue;
      const told = await focused.evaluate(
        (element) => element.getAttribute("aria-label") ?? element.textContent?.trim() ?? "",
      );
      if (told.startsWith(name)) {
        const outline = await focused.evaluate((element) => getComputedStyle(element).outlineStyle);
        expect(outline, `${name} shows that it has the focus`).not.toBe("none");
        return;
      }
    }
    throw new Error(`Tab does not lead to ${name}`);
  };
  await page.keyboard.press("Tab");
  await expect(page.locator(":focus")).toHaveText(common.skip);
  await tabTo(common.teach);
  await page.keyboard.press("Enter");
  await expect(page.getByRole("heading", { name: teach.title, level: 1 })).toBeVisible();
  await tabTo("home");
  await page.keyboard.press("Enter");
  await expect(page.getByRole("option").first()).toBeVisible();
  await tabTo(teach.addPictures);
  await page.keyboard.press("Enter");
  await expect(page.getByRole("dialog")).toBeVisible();
  await page.keyboard.press("Escape");
  await expect(page.getByRole("dialog")).toHaveCount(0);
  // The focus comes back to where it was.
  await expect(page.getByRole("button", { name: teach.addPictures })).toBeFocused();
  await tabTo("bathroom");
  await page.keyboard.press("Enter");
  await expect(async () => {
    await page.keyboard.press("Tab");
    await expect(page.getByRole("listbox")).toBeFocused({ timeout: 200 });
  }).toPass();
  await page.keyboard.press("ArrowRight");
  await page.keyboard.press(" ");
  await expect(page.getByText(teach.selected(1), { exact: true })).toBeVisible();
});
