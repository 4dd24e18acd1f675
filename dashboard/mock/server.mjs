// Answers the page's calls with made-up data, for work on the page without a service: `npm run mock`, then `npm run dev`.
//   ROBOTS=200   how many robots there are
//   KEYS=1       asks for a key: rs_admin or rs_viewer

import { createServer } from "node:http";
import { problem } from "./answers.mjs";
import { auditCall } from "./audit.mjs";
import { inboxCall } from "./inbox.mjs";
import { liveCall, liveEvents, robotsCall } from "./robots.mjs";
import { mapCall, modelsCall } from "./models.mjs";
import { pageCall } from "./page.mjs";
import { recognizeCall } from "./recognize.mjs";
import { keysCall, serviceCall } from "./service.mjs";
import { sessionCall, whoIs } from "./session.mjs";
import { setsCall } from "./sets.mjs";
import { acceptStream } from "./stream.mjs";
import { trainingsCall } from "./trainings.mjs";

const PORT = Number(process.env.PORT ?? 18101);

// The first that fits answers; a call that answers undefined leaves it to those after it.
const calls = [
  [/^\/v1\/session/, sessionCall],
  [/^\/v1\/service/, serviceCall],
  [/^\/v1\/keys/, keysCall],
  [/^\/v1\/audit/, auditCall],
  [/^\/v1\/live$/, liveCall],
  [/^\/v1\/robots/, robotsCall],
  [/^\/v1\/recognize$/, recognizeCall],
  [/^\/v1\/models\/[^/]+\/versions\/\d+\/map$/, mapCall],
  [/^\/v1\/models/, modelsCall],
  [/^\/v1\/sets/, setsCall],
  [/^\/v1\/inbox/, inboxCall],
  [/^\/v1\/trainings/, trainingsCall],
];

async function bodyOf(incoming) {
  const parts = [];
  for await (const part of incoming) parts.push(part);
  return Buffer.concat(parts);
}

async function answerTo(incoming, url) {
  const body = await bodyOf(incoming);
  const request = {
    method: incoming.method,
    headers: incoming.headers,
    body,
    json: () => JSON.parse(body.toString() || "{}"),
  };
  if (!url.pathname.startsWith("/v1/")) return pageCall(url);
  if (!url.pathname.startsWith("/v1/session") && !whoIs(request)) {
    return problem(401, "unauthorized", "Sign in with a key.");
  }
  for (const [pattern, call] of calls) {
    const answer = pattern.test(url.pathname) ? call(request, url) : undefined;
    if (answer) return answer;
  }
  return problem(404, "not-found", `There is nothing at ${url.pathname}.`);
}

const server = createServer((incoming, outgoing) => {
  const url = new URL(incoming.url, "http://mock");
  answerTo(incoming, url)
    .catch((error) => problem(500, "internal", String(error)))
    .then((answer) => {
      if (answer.events) return liveEvents(outgoing);
      const type = answer.type ? { "Content-Type": answer.type } : {};
      outgoing.writeHead(answer.status, {
        ...type,
        "Cache-Control": "no-cache",
        ...answer.headers,
      });
      return outgoing.end(answer.body);
    });
});
server.on("upgrade", acceptStream);
server.listen(PORT, "127.0.0.1", () => console.log(`mock: http://127.0.0.1:${PORT}`));
