import { ApiError, messageOf } from "../../api/client";
import type { Judgment } from "./sender";

/** What to do with pictures that could not be sent. */
export function judge(error: unknown): Judgment {
  const reason = messageOf(error);
  if (!(error instanceof ApiError)) return { then: "stop", reason };
  // No answer, too many requests, or a service that starts or stops: they pass by themselves.
  const passes = [0, 408, 429, 502, 503, 504];
  if (passes.includes(error.status) && !error.is("no-data-directory")) {
    return { then: "again", reason };
  }
  const isOfThePicture = [400, 413, 415, 422];
  if (isOfThePicture.includes(error.status)) return { then: "drop", reason };
  return { then: "stop", reason };
}
