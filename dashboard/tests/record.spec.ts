import { execFileSync } from "node:child_process";
import type { Page } from "@playwright/test";
import { text } from "../src/texts/teach";
import { removeFolder, temporaryFolder } from "./support/folders";
import { Service } from "./support/service";
import { expect, test } from "./support/test";

/** Begins to record a room of a set with the camera. */
async function record(page: Page, room: string): Promise<void> {
  await page.getByLabel(text.recordRoom).fill(room);
  await page.getByRole("button", { name: text.recordStart }).click();
}

const taken = async (page: Page) =>
  Number(await page.getByRole("progressbar").locator("strong").textContent());

const finish = (page: Page) => page.getByRole("button", { name: text.recordFinish }).click();

interface SetSummary {
  rooms: { name: string; frames: number }[];
}

test("a room is recorded with the camera until it is enough", async ({ page, service }) => {
  await service.call("PUT", "sets/home");
  await page.goto("#/teach/home");
  await page.getByRole("button", { name: text.record }).click();
  await record(page, "kitchen");
  await expect(page.getByText(text.recordEnough)).toBeVisible({ timeout: 45_000 });
  await finish(page);
  await expect(page.getByText(/^kitchen: \d+ frames recorded\.$/)).toBeVisible();
  const { rooms } = await service.call<SetSummary>("GET", "sets/home");
  expect(rooms).toHaveLength(1);
  expect(rooms[0]?.frames).toBeGreaterThanOrEqual(40);
  await page.getByRole("button", { name: text.recordSee }).click();
  await expect(page.getByRole("listbox").getByRole("option").first()).toBeVisible();
});

test("a service that goes away while recording gets the frames later", async ({
  page,
  service,
}) => {
  await service.call("PUT", "sets/home");
  await page.goto("#/teach/home/record");
  await record(page, "kitchen");
  await expect.poll(() => taken(page)).toBeGreaterThan(2);
  await service.stop();
  await expect(page.getByText(/^The service does not answer\. Pictures wait/)).toBeVisible();
  await service.run();
  await expect(page.getByText(/^The service does not answer\. Pictures wait/)).toHaveCount(0);
  await finish(page);
  await expect(page.getByText(/^kitchen: \d+ frames recorded\.$/)).toBeVisible();
  const { rooms } = await service.call<SetSummary>("GET", "sets/home");
  await expect(page.getByText(`kitchen: ${rooms[0]?.frames} frames recorded.`)).toBeVisible();
});

test("a full disk stops the recording, and nothing of it is lost", async ({ page, service }) => {
  await service.call("PUT", "sets/home");
  await page.goto("#/teach/home/record");
  let isFull = false;
  await page.route("**/v1/sets/home/frames?**", async (route) => {
    if (!isFull) return await route.continue();
    const problem = { type: "/problems/disk-full", title: "Full", status: 507, detail: "No room." };
    await route.fulfill({ status: 507, json: problem, contentType: "application/problem+json" });
  });
  await record(page, "kitchen");
  await expect.poll(() => taken(page)).toBeGreaterThan(2);
  isFull = true;
  await expect(page.getByRole("alert")).toContainText("No room.");
  await expect(page.getByText(text.recordHeld)).toBeVisible();
  const held = await taken(page);
  isFull = false;
  await page.getByRole("button", { name: text.recordTryAgain }).click();
  await expect(page.getByRole("alert")).toHaveCount(0);
  await expect.poll(() => taken(page)).toBeGreaterThan(held);
  await finish(page);
  await expect(page.getByText(/^kitchen: \d+ frames recorded\.$/)).toBeVisible();
  const { rooms } = await service.call<SetSummary>("GET", "sets/home");
  await expect(page.getByText(`kitchen: ${rooms[0]?.frames} frames recorded.`)).toBeVisible();
});

test("a disk that is really full is told", async ({ page }) => {
  const folder = await temporaryFolder();
  try {
    execFileSync("mount", ["-t", "tmpfs", "-o", "size=1m", "tmpfs", folder], { stdio: "ignore" });
  } catch {
    await removeFolder(folder);
    test.skip(true, "only root may mount a small disk");
  }
  const service = await Service.start({ dataFolder: folder });
  try {
    await service.call("PUT", "sets/home");
    await page.goto(`${service.url}/#/teach/home/record`);
    await record(page, "kitchen");
    await expect(page.getByText(text.recordHeld)).toBeVisible();
    await expect(page.getByRole("alert")).toContainText(/full|space/i);
    const kept = (await service.call<SetSummary>("GET", "sets/home")).rooms[0]?.frames ?? 0;
    expect(kept).toBeLessThan(await taken(page));
  } finally {
    await service.remove();
    execFileSync("umount", [folder]);
    await removeFolder(folder);
  }
});
