import { text } from "../texts/common";

/** A refusal by the service (`application/problem+json`), or what kept it from answering. */
export class ApiError extends Error {
  constructor(
    /** The HTTP status; 0 where no answer came. */
    readonly status: number,
    /** The kind, such as `/problems/no-data-directory`. */
    readonly kind: string,
    readonly title: string,
    detail: string,
    readonly requestId?: string,
  ) {
    super(detail);
    this.name = "ApiError";
  }

  /** Whether it is of this kind, named without its path. */
  is(kind: string): boolean {
    return this.kind.endsWith(`/problems/${kind}`);
  }
}

/** What a person reads about whatever was thrown. */
export function messageOf(error: unknown): string {
  return error instanceof Error ? error.message : String(error);
}

/** Whether it only says that nobody wants the answer any more. */
export function isAbort(error: unknown): boolean {
  return error instanceof DOMException && error.name === "AbortError";
}

export interface CallOptions {
  method?: "GET" | "POST" | "PUT" | "DELETE";
  /** What is left undefined is left out. */
  query?: Record<string, string | number | boolean | undefined>;
  /** Sent as JSON. */
  json?: unknown;
  /** Sent as it is. */
  body?: Blob | FormData;
  headers?: Record<string, string>;
  signal?: AbortSignal;
}

type Listener = () => void;
let whenRefused: Listener = () => undefined;

/** Calls `listener` whenever the service says that nobody is signed in. */
export function onUnauthorized(listener: Listener): void {
  whenRefused = listener;
}

/** The address of a call: relative to the page, which may lie under a prefix. */
export function address(path: string, query: CallOptions["query"] = {}): string {
  const url = new URL(path, document.baseURI);
  url.hash = "";
  for (const [name, value] of Object.entries(query)) {
    if (value !== undefined) url.searchParams.set(name, String(value));
  }
  return url.href;
}

/** A part of a path: names of rooms and robots may hold anything. */
export function part(name: string | number): string {
  return encodeURIComponent(name);
}

/** Calls the service, and gives the answer as it came; throws an `ApiError` if it was refused. */
export async function fetchFrom(path: string, options: CallOptions = {}): Promise<Response> {
  const headers = new Headers({ Accept: "application/json", ...options.headers });
  let body: BodyInit | undefined = options.body;
  if (options.json !== undefined) {
    headers.set("Content-Type", "application/json");
    body = JSON.stringify(options.json);
  }
  let response: Response;
  try {
    response = await fetch(address(path, options.query), {
      method: options.method ?? "GET",
      headers,
      body,
      signal: options.signal,
      credentials: "same-origin",
    });
  } catch (error) {
    if (isAbort(error)) throw error;
    throw new ApiError(0, "", text.unreachable, text.unreachableDetail);
  }
  if (response.ok) return response;
  const problem = await problemOf(response);
  if (response.status === 401) whenRefused();
  throw problem;
}

/** Calls the service, and gives what it answered as JSON. */
export async function call<T>(path: string, options: CallOptions = {}): Promise<T> {
  const response = await fetchFrom(path, options);
  return (response.status === 204 ? undefined : await response.json()) as T;
}

async function problemOf(response: Response): Promise<ApiError> {
  const fallback = text.refused(response.status, response.statusText);
  try {
    const problem = (await response.json()) as Partial<Record<string, string>>;
    return new ApiError(
      response.status,
      problem.type ?? "",
      problem.title ?? fallback,
      problem.detail ?? problem.title ?? fallback,
      problem.request_id,
    );
  } catch {
    return new ApiError(response.status, "", fallback, fallback);
  }
}
