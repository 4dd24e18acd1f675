import { call, part } from "./client";
import type { Role } from "./session";

/** A key, without what it is. */
export interface KeyInfo {
  name: string;
  role: Role;
  /** The robots that it is bound to; none: any. */
  robots: string[];
  made_at?: string;
  from: "settings" | "page";
}

export interface NewKey {
  name: string;
  role: Role;
  robots?: string[];
}

/** A key that was just made: the only time that it is told. */
export interface MadeKey extends NewKey {
  key: string;
}

export const listKeys = async (signal?: AbortSignal) =>
  (await call<{ keys: KeyInfo[] }>("v1/keys", { signal })).keys;

export const makeKey = (key: NewKey) => call<MadeKey>("v1/keys", { method: "POST", json: key });

export const revokeKey = (name: string) =>
  call<void>(`v1/keys/${part(name)}`, { method: "DELETE" });
