import { readdir, writeFile } from "node:fs/promises";
import { join } from "node:path";
import type { Page } from "@playwright/test";
import { percent } from "../src/format";
import { text as audit } from "../src/texts/audit";
import { text } from "../src/texts/models";
import { text as teach } from "../src/texts/teach";
import { framesOf, MODEL, OTHER_ROOM, ROOM } from "./support/frames";
import { layOut } from "./support/folders";
import type { Service } from "./support/service";
import { expect, test } from "./support/test";

/** A data set that is trained on in a few seconds. */
async function makeSet(service: Service): Promise<void> {
  const frames = [];
  for (const room of [ROOM, OTHER_ROOM]) {
    for (const drive of ["cloudy1", "cloudy2"]) {
      frames.push(...(await framesOf(room, drive)).slice(0, 6));
    }
  }
  await service.makeSet("home", frames);
}

/** Begins a training from the page of a data set. */
async function train(page: Page, set: string, model = MODEL): Promise<void> {
  await page.goto(`#/teach/${set}`);
  await page.getByRole("button", { name: teach.train, exact: true }).click();
  const dialog = page.getByRole("dialog");
  await dialog.getByLabel(teach.trainModel).fill(model);
  await dialog.getByLabel(teach.trainEffort).selectOption("fast");
  await dialog.getByRole("button", { name: teach.trainStart }).click();
  await expect(page.getByRole("heading", { name: text.training(1) })).toBeVisible();
}

/** Publishes further versions of the model, which are copies of the first, and which nobody is served by. */
async function addVersions(service: Service, ...versions: number[]): Promise<void> {
  const first = join(service.models, MODEL, "1");
  for (const version of versions) {
    const folder = join(service.models, MODEL, String(version));
    const names = ["model.json", "model.safetensors"];
    await layOut(folder, Object.fromEntries(names.map((name) => [name, join(first, name)])));
  }
}

const row = (page: Page, version: number) =>
  page
    .getByRole("listitem")
    .filter({ has: page.getByText(text.version(version), { exact: true }) });

const badge = (page: Page, version: number, label: string) =>
  row(page, version).locator(".badge", { hasText: label });

test("what was trained goes into service step by step, and back", async ({ page, service }) => {
  test.slow();
  await makeSet(service);
  await train(page, "home");
  await expect(page.getByText(text.trainingStates.running, { exact: true })).toBeVisible();
  await expect(page.getByRole("progressbar", { name: text.training(1) })).toBeVisible();
  // It gives way to all other processes.
  await expect(page.getByRole("heading", { name: text.comparison })).toBeVisible({
    timeout: 120_000,
  });
  await expect(page.getByRole("heading", { name: text.confusion })).toBeVisible();
  const serving = `${MODEL}/1`;
  await expect(page.locator(".bars").filter({ hasText: serving })).toBeVisible();
  await page.getByRole("button", { name: text.publishShadow }).click();
  await expect(badge(page, 2, text.shadow)).toBeVisible();

  // The shadow sees what robots send.
  for (const frame of (await framesOf(OTHER_ROOM, "cloudy2")).slice(0, 4)) {
    await service.recognize("wall-e", frame);
  }
  await expect(row(page, 2)).toContainText(text.agreement);

  await row(page, 2).getByLabel(text.share).selectOption("0.5");
  await row(page, 2).getByRole("button", { name: text.asCanary }).click();
  await expect(badge(page, 2, text.canary(percent(0.5)))).toBeVisible();
  await row(page, 2).getByRole("button", { name: text.asStable }).click();
  await expect(badge(page, 2, text.stable)).toBeVisible();
  await expect(badge(page, 1, text.previous)).toBeVisible();

  await page.getByRole("button", { name: text.rollBackTo(1) }).click();
  await expect(badge(page, 1, text.stable)).toBeVisible();
  const { serving: now } = await service.call<{ serving: number }>("GET", `models/${MODEL}`);
  expect(now).toBe(1);

  await page.getByRole("tab", { name: text.tabs.audit }).click();
  for (const what of ["train", "publish", "label", "activate", "rollback"]) {
    const told = audit.actions[what] ?? "";
    await expect(page.getByRole("cell", { name: told, exact: true }).first()).toBeVisible();
  }
});

test("a training is cancelled", async ({ page, service }) => {
  // More frames than are read in a moment.
  await service.makeSet("home", await framesOf("*", "cloudy1"));
  await train(page, "home");
  await page.getByRole("button", { name: text.cancelTraining }).click();
  const question = page.getByRole("dialog", { name: text.cancelTitle });
  await question.getByRole("button", { name: text.cancelTraining }).click();
  await expect(page.getByText(text.trainingStates.cancelled)).toBeVisible();
  await page.getByRole("link", { name: text.backToTrainings }).click();
  await expect(page.getByText(text.trainingStates.cancelled)).toBeVisible();
});

test("a training that fails says why", async ({ page, service }) => {
  await makeSet(service);
  // A disk went bad, or somebody copied something else over the pictures.
  for (const drive of ["cloudy1", "cloudy2"]) {
    const folder = join(service.data, "sets/home", ROOM, drive);
    for (const file of await readdir(folder)) await writeFile(join(folder, file), "no picture");
  }
  await train(page, "home");
  await expect(page.getByText(text.trainingStates.failed)).toBeVisible({ timeout: 40_000 });
  await expect(page.getByRole("alert")).toContainText(/room|picture/i);
  await page.goto("#/models");
  await expect(badge(page, 1, text.stable)).toBeVisible();
});

test("a change of what somebody else has changed is told, and done anew", async ({
  page,
  service,
}) => {
  await addVersions(service, 2);
  // A newer version serves by itself, so that the one before can come back.
  await page.goto("#/models");
  await expect(badge(page, 2, text.stable)).toBeVisible();
  // The list is not loaded again by itself while the other one is at it.
  await page.clock.install();
  await page.clock.pauseAt(Date.now() + 1000);
  const { epoch } = await service.call<{ epoch: number }>("GET", `models/${MODEL}`);
  await service.call("POST", `models/${MODEL}/versions/1/activate`);
  expect((await service.call<{ epoch: number }>("GET", `models/${MODEL}`)).epoch).not.toBe(epoch);
  await row(page, 1).getByRole("button", { name: text.asStable }).click();
  await expect(page.getByText(text.stale)).toBeVisible();
  await expect(badge(page, 1, text.stable)).toBeVisible();
});

test("two versions stand side by side", async ({ page, service }) => {
  await addVersions(service, 2);
  await page.goto("#/models");
  await expect(badge(page, 2, text.stable)).toBeVisible();
  await row(page, 1).getByRole("link", { name: text.compare }).click();
  await expect(page.getByLabel(text.first)).toHaveValue(/2/);
  await expect(page.getByLabel(text.second)).toHaveValue(/1/);
  await expect(page.getByRole("heading", { name: `${MODEL}/1` })).toBeVisible();
  await expect(page.getByRole("heading", { name: `${MODEL}/2` })).toBeVisible();
  await page.goto("#/models/lab/1");
  await expect(page.getByRole("heading", { name: `${MODEL}/1` })).toBeVisible();
});
