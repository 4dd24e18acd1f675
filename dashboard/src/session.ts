import { computed, signal } from "@preact/signals";
import { ApiError, onUnauthorized } from "./api/client";
import { getService, type ServiceInfo } from "./api/service";
import { getSession, type Role, type SessionInfo, signOut as endSession } from "./api/session";
import { text } from "./texts/common";

/** Whether somebody is signed in; `out` keeps the page in place if there was somebody before. */
export type SessionState =
  | { kind: "checking" }
  | { kind: "failed"; error: unknown }
  | { kind: "out"; before: boolean }
  | { kind: "in"; info: SessionInfo };

export const session = signal<SessionState>({ kind: "checking" });

/** Counts how often somebody signed in: what was loaded before is loaded again. */
export const signIns = signal(0);

/** What the service says of itself; undefined until it did. */
export const service = signal<ServiceInfo | undefined>(undefined);

const role = computed<Role | undefined>(() => {
  const state = session.value;
  if (state.kind !== "in") return undefined;
  // A service without keys names no role: everyone may do everything.
  return state.info.role ?? "admin";
});

/** Why something that takes this role is not allowed; undefined where it is. An admin may do everything. */
export function blockedFor(needed: Role): string | undefined {
  return role.value === "admin" || role.value === needed ? undefined : text.needsRole(needed);
}

/** The same for what also needs the data directory. */
export function blockedForData(needed: Role): string | undefined {
  return blockedFor(needed) ?? (service.value?.data === false ? text.noData : undefined);
}

export function signedIn(info: SessionInfo): void {
  session.value = { kind: "in", info };
  signIns.value += 1;
  void loadService();
}

export async function checkSession(): Promise<void> {
  try {
    signedIn(await getSession());
  } catch (error) {
    if (!(error instanceof ApiError && error.status === 401)) {
      session.value = { kind: "failed", error };
    }
  }
}

/** Finds out whether the session still stands; where it does not, signing in is asked for. */
export async function probeSession(): Promise<void> {
  try {
    await getSession();
  } catch {
    // A refusal was heard of where the answer came in; without an answer there is nothing to say.
  }
}

export async function signOut(): Promise<void> {
  await endSession();
  session.value = { kind: "out", before: false };
  service.value = undefined;
}

async function loadService(): Promise<void> {
  try {
    service.value = await getService();
  } catch {
    // The pages say themselves what they could not load.
  }
}

onUnauthorized(() => {
  const { kind } = session.peek();
  if (kind !== "out") session.value = { kind: "out", before: kind === "in" };
});
