import { text as common } from "../src/texts/common";
import { Foreign } from "./support/foreign";
import { framesOf, MODEL, ROOM } from "./support/frames";
import { expect, test } from "./support/test";

/** What a page of another origin is told. */
type Told = Record<"read" | "write" | "socket" | "events" | "picture", string>;

for (const hasKeys of [true, false]) {
  const kind = hasKeys ? "a service that somebody is signed in to" : "an open service";
  test(`a page of another origin can do nothing to ${kind}`, async ({ page, service }) => {
    const [frame = ""] = await framesOf(ROOM, "cloudy2");
    await service.makeSet("home", [frame]);
    if (hasKeys) {
      const { admin } = await service.makeKeys();
      await page.goto("#/teach");
      await page.getByLabel(common.key).fill(admin);
      await page.getByRole("button", { name: common.signIn, exact: true }).click();
      await expect(page.getByText(common.signedInAs("admin-key", "admin"))).toBeVisible();
    }
    await service.recognize("wall-e", frame);
    // Another port is another origin, yet the same site: cookies go along.
    const foreign = await Foreign.listen((_, answer) => {
      answer.writeHead(200, { "content-type": "text/html" }).end("<title>foreign</title>");
    });
    const visitor = await page.context().newPage();
    await visitor.goto(foreign.url);
    const told = await visitor.evaluate(attack, service.url);
    expect(told).toEqual({
      read: "failed",
      write: "failed",
      socket: "closed",
      events: "closed",
      picture: "failed",
    } satisfies Told);

    // A form needs nobody's permission to be sent.
    await visitor.evaluate((url) => {
      const form = document.createElement("form");
      Object.assign(form, { method: "post", enctype: "text/plain", action: url });
      document.body.append(form);
      form.submit();
    }, `${service.url}/v1/models/${MODEL}/rollback`);
    await expect(visitor).toHaveURL(/rollback$/);
    await expect(visitor.locator("body")).toContainText(/"status": ?4\d\d/);
    expect(await service.call("GET", "sets")).toMatchObject({ sets: [{ name: "home" }] });
    // Nor can it put the page into a frame of its own.
    await visitor.goto(foreign.url);
    await visitor.evaluate((url) => {
      const frame = document.createElement("iframe");
      frame.src = url;
      document.body.append(frame);
    }, `${service.url}/`);
    await expect(visitor.frameLocator("iframe").locator(".brand")).toHaveCount(0);
    await foreign.close();

    // All of it works for the service's own page: it was the origin that was refused.
    await page.goto("#/live");
    expect(await page.evaluate(attack, service.url)).toEqual({
      read: "worked",
      write: "worked",
      socket: "open",
      events: "open",
      picture: "worked",
    } satisfies Told);
  });
}

/** Tries what scripts can, in a page of another origin. */
async function attack(service: string): Promise<Told> {
  const fate = async (attempt: Promise<unknown>) =>
    await attempt.then(
      () => "worked",
      () => "failed",
    );
  const opened = (source: EventSource | WebSocket) =>
    new Promise<string>((resolve) => {
      source.onopen = () => resolve("open");
      source.onerror = () => resolve("closed");
    });
  const events = opened(new EventSource(`${service}/v1/live`, { withCredentials: true }));
  const stream = `${service.replace("http", "ws")}/v1/stream?robot=evil`;
  const socket = opened(new WebSocket(stream, "roomsight.v1"));
  const image = new Image();
  image.src = `${service}/v1/robots/wall-e/frame?width=64`;
  return {
    read: await fate(fetch(`${service}/v1/sets`, { credentials: "include" })),
    write: await fate(
      fetch(`${service}/v1/sets/home`, { method: "DELETE", credentials: "include" }),
    ),
    socket: await socket,
    events: await events,
    picture: await fate(image.decode()),
  };
}

test("the page runs no script but its own", async ({ page }) => {
  await page.goto("#/live");
  const blocked = await page.evaluate(async () => {
    const told = new Promise<string>((resolve) =>
      document.addEventListener("securitypolicyviolation", (event) =>
        resolve(event.effectiveDirective),
      ),
    );
    const script = document.createElement("script");
    script.textContent = "document.title = 'hacked'";
    document.body.append(script);
    return await told;
  });
  expect(blocked).toMatch(/^script-src/);
  await expect(page).not.toHaveTitle("hacked");
});

test("nothing comes from anywhere else", async ({ page, service }) => {
  const origins = new Set<string>();
  page.on("request", (request) => {
    if (!/^(data|blob):/.test(request.url())) origins.add(new URL(request.url()).origin);
  });
  for (const name of ["live", "try", "teach", "inbox", "models", "service"]) {
    await page.goto(`#/${name}`);
    await expect(page.getByRole("heading", { level: 1 })).toBeVisible();
  }
  expect([...origins]).toEqual([service.url]);
});
