import { text as common } from "../src/texts/common";
import { text } from "../src/texts/live";
import { darkness, framesOf, OTHER_ROOM, ROOM } from "./support/frames";
import { Robots } from "./support/robots";
import { expect, test } from "./support/test";

test("without robots the page says how one comes", async ({ page }) => {
  await page.goto("#/live");
  await expect(page.getByRole("heading", { name: text.none })).toBeVisible();
  await page.getByRole("link", { name: text.openTry }).click();
  await expect(page).toHaveURL(/#\/try$/);
});

test("a robot changes rooms while somebody looks", async ({ page, service }) => {
  const [here = ""] = await framesOf(ROOM, "cloudy2");
  const [there = ""] = await framesOf(OTHER_ROOM, "cloudy2");
  await service.recognize("wall-e", here);
  await page.goto("#/live");
  const robot = page.getByRole("article", { name: "wall-e" });
  await expect(robot.locator(".verdict-room")).toHaveText(ROOM);
  await expect(robot.locator(".verdict-more")).toContainText(common.known);
  await expect(robot.getByRole("img", { name: text.frameOf("wall-e") })).toBeVisible();

  await service.recognize("wall-e", there);
  await expect(robot.locator(".verdict-room")).toHaveText(OTHER_ROOM);
  await expect(robot.locator(".bars li").first()).toContainText(OTHER_ROOM);
  // The ribbon has both rooms, the newest named first.
  const ribbon = text.ribbonOf(10, `${OTHER_ROOM}, ${ROOM}`);
  await expect(robot.getByRole("img", { name: ribbon })).toBeVisible();

  await service.recognize("wall-e", darkness());
  await expect(robot.locator(".verdict-more")).toContainText(common.notKnown);
  await expect(robot.locator(".verdict-more")).toContainText(common.reasons.dark);
});

test.describe("robots that are lost", () => {
  test.use({ serviceOptions: { settings: { lost_after_ms: 200 } } });

  test("stand first, and those that left stand last", async ({ page, service }) => {
    const [frame = ""] = await framesOf(ROOM, "cloudy2");
    await Robots.drive(service, { limit: 2 }).finished();
    await service.recognize("alpha", frame);
    await expect
      .poll(async () => {
        await service.recognize("zeta", darkness());
        return await service.call("GET", "robots/zeta");
      })
      .toMatchObject({ lost: true });
    await page.goto("#/live");
    const cards = page.getByRole("article");
    await expect(cards).toHaveCount(3);
    await expect(cards.nth(0)).toContainText(/Lost for/);
    await expect(cards.nth(2)).toContainText(/Last seen .+ ago/);
    await expect(cards.locator("h2")).toHaveText(["zeta", "alpha", "replay-0"]);
    await expect(page.getByText(text.counts(3, 1, 1))).toBeVisible();

    await page.getByLabel(text.state).selectOption({ label: text.states.left });
    await expect(cards.locator("h2")).toHaveText(["replay-0"]);
  });
});

test("robots over streams are followed and found", async ({ page, service }) => {
  const robots = Robots.drive(service, { robots: 2 });
  await page.goto("#/live");
  const cards = page.getByRole("article");
  await expect(cards.locator("h2")).toHaveText(["replay-0", "replay-1"]);
  // Frames a second come in while they drive.
  await expect(cards.first().locator(".robot-foot")).toContainText(/[1-9]\.\d frames\/s/);
  const picture = cards.first().getByRole("img", { name: text.frameOf("replay-0") });
  const first = await picture.getAttribute("src");
  await expect(picture).not.toHaveAttribute("src", first ?? "");

  await page.getByLabel(text.search).fill("play-1");
  await expect(cards.locator("h2")).toHaveText(["replay-1"]);
  await page.getByLabel(text.search).fill("nobody");
  await page.getByRole("button", { name: text.showAll }).click();
  await expect(cards).toHaveCount(2);
  await robots.stop();
});

test("robots stand in the graph of rooms and on the map", async ({ page, service }) => {
  const [frame = ""] = await framesOf(ROOM, "cloudy2");
  await service.recognize("wall-e", frame);
  await page.goto("#/live");
  await page.getByRole("tab", { name: text.rooms }).click();
  const graph = page.getByRole("group", { name: text.graph });
  await expect(graph.locator(".room-name")).toHaveCount(4);
  await expect(graph.locator(".way")).not.toHaveCount(0);
  const mark = page.getByRole("link", { name: text.robotIn("wall-e", ROOM, common.known) });
  await expect(mark).toBeVisible();

  await page.getByRole("tab", { name: text.map }).click();
  await expect(page.getByRole("group", { name: text.positions })).toBeVisible();
  await mark.click();
  await expect(page.getByRole("heading", { name: "wall-e", level: 1 })).toBeVisible();
});

test("the last answer of a robot is explained", async ({ page, service }) => {
  const [frame = ""] = await framesOf(ROOM, "cloudy2");
  await service.recognize("wall-e", frame);
  await page.goto("#/live/wall-e");
  await expect(page.getByRole("region", { name: text.numbersTitle })).toContainText("lab/1");
  await page.getByRole("button", { name: text.explain }).click();
  const evidence = page.getByRole("img", { name: common.evidence });
  await expect(evidence.locator(".for")).not.toHaveCount(0);
  const nearest = page.getByRole("region", { name: common.nearest }).getByRole("button");
  await expect(nearest.first()).toContainText(ROOM);
  await nearest.first().click();
  await expect(evidence.locator(".shared")).not.toHaveCount(0);
  await page.getByRole("button", { name: text.explainStop }).click();
  await expect(evidence).toHaveCount(0);
});
