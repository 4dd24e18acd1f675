import { call } from "./client";

/** Something that somebody did. */
export interface AuditEntry {
  id: number;
  at: string;
  who: string;
  what: string;
  target: string;
  detail: string;
}

export interface AuditPage {
  entries: AuditEntry[];
  next?: number;
}

/** What was done, the newest first; `before` is the oldest that is there already. */
export const listAudit = (before?: number, limit = 50, signal?: AbortSignal) =>
  call<AuditPage>("v1/audit", { query: { before, limit }, signal });
