import { call } from "./client";

export type Role = "robot" | "viewer" | "admin";

/** Who is signed in; all is left out by a service without keys. */
export interface SessionInfo {
  name?: string;
  role?: Role;
  expires_in_s?: number;
}

export const getSession = (signal?: AbortSignal) => call<SessionInfo>("v1/session", { signal });

export const signIn = (key: string) =>
  call<SessionInfo>("v1/session", { method: "POST", headers: { Authorization: `Bearer ${key}` } });

export const signInWithCode = (code: string) =>
  call<SessionInfo>("v1/session/code", { method: "POST", json: { code } });

export const signOut = () => call<void>("v1/session", { method: "DELETE" });
