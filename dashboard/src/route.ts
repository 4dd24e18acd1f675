import { signal } from "@preact/signals";

export const PAGES = ["live", "try", "teach", "inbox", "models", "service"] as const;
export type Page = (typeof PAGES)[number];

/** Where the page is: `#/live/wall-e` is the page `live` with the rest `["wall-e"]`. */
export interface Route {
  page: Page | "code";
  rest: string[];
}

/** Reads the fragment of an address; what is not known leads to Live. */
export function parseRoute(hash: string): Route {
  const parts = hash
    .replace(/^#?\/?/, "")
    .split("/")
    .filter(Boolean)
    .map(decode);
  const [first, ...rest] = parts;
  const page = first === "code" ? "code" : PAGES.find((name) => name === first);
  return page ? { page, rest } : { page: "live", rest: [] };
}

function decode(part: string): string {
  try {
    return decodeURIComponent(part);
  } catch {
    return part;
  }
}

/** The address of a page, for links. */
export function href(page: Page, ...rest: (string | number)[]): string {
  return `#/${[page, ...rest].map(encodeURIComponent).join("/")}`;
}

export const route = signal<Route>(parseRoute(location.hash));

addEventListener("hashchange", () => {
  route.value = parseRoute(location.hash);
});

/** Goes to a page; with `replace` the one before is not kept in the history. */
export function go(to: string, replace = false): void {
  if (!replace) {
    location.hash = to;
    return;
  }
  history.replaceState(null, "", to);
  route.value = parseRoute(location.hash);
}

/** What every page gets: the parts of the address after its own name. */
export interface PageProps {
  rest: string[];
}
