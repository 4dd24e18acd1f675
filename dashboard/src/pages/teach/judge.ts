import { ApiError, messageOf } from "../../api/client";
import type { Judgment } from "./sender";

const DISK_FULL = 507;

/** What to do with pictures that could not be sent. */
export function judge(error: unknown): Judgment {
  const reason = messageOf(error);
  if (!(error instanceof ApiError)) return { then: "stop", reason };
  // No answer, too many requests, a service that starts, stops or stumbles: they pass by themselves.
  const needsSomebody = error.status === DISK_FULL || error.is("no-data-directory");
  const passes = [0, 408, 429].includes(error.status) || error.status >= 500;
  if (passes && !needsSomebody) return { then: "again", reason };
  const isOfThePicture = [400, 413, 415, 422];
  if (isOfThePicture.includes(error.status)) return { then: "drop", reason };
  return { then: "stop", reason };
}
