// What was done, by whom.

import { json } from "./answers.mjs";

const entries = [];

/** Writes an entry, as the service does with every change. */
export function noteAudit(what, target, detail) {
  entries.push({
    id: entries.length + 1,
    at: new Date().toISOString(),
    who: "admin",
    what,
    target,
    detail,
  });
}

/** Calls of `v1/audit`. */
export function auditCall(_request, url) {
  const before = Number(url.searchParams.get("before") ?? entries.length + 1);
  const limit = Number(url.searchParams.get("limit") ?? 100);
  const until = Math.max(before - 1 - limit, 0);
  const page = entries.slice(until, before - 1).reverse();
  return json(200, { entries: page, ...(until > 0 ? { next: page.at(-1).id } : {}) });
}
