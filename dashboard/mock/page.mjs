// The page as it was built, under the content security policy that the service sends.

import { readFile } from "node:fs/promises";
import { extname, join, normalize } from "node:path";
import { problem } from "./answers.mjs";

const FOLDER = new URL("../dist/page/", import.meta.url).pathname;
const POLICY =
  "default-src 'self'; img-src 'self' blob: data:; media-src 'self' blob:; connect-src 'self' ws: wss:; style-src 'self'; " +
  "script-src 'self'; frame-ancestors 'none'; base-uri 'none'; form-action 'self'";
const TYPES = {
  ".html": "text/html",
  ".js": "text/javascript",
  ".css": "text/css",
  ".svg": "image/svg+xml",
};

/** A file of the page; its first document where none is named. */
export async function pageCall(url) {
  const path = normalize(url.pathname === "/" ? "/index.html" : url.pathname);
  try {
    const body = await readFile(join(FOLDER, path));
    const type = TYPES[extname(path)] ?? "application/octet-stream";
    return { status: 200, type, body, headers: { "Content-Security-Policy": POLICY } };
  } catch {
    return problem(404, "not-found", `There is nothing at ${path}. Build the page: npm run build`);
  }
}
