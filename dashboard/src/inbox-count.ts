import { signal } from "@preact/signals";
import { useEffect } from "preact/hooks";
import { listInbox } from "./api/inbox";
import { useLoad } from "./hooks";
import { service } from "./session";

/** How many frames wait in the inbox, for the navigation; whoever hears of it says so. */
export const inboxOpen = signal(0);

const EVERY_MS = 30_000;

/** Counts them now and then, while the service keeps an inbox. */
export function useInboxCount(): void {
  const isKept = service.value?.data ?? false;
  const { data } = useLoad(
    async (signal) => {
      if (!isKept) return 0;
      return (await listInbox({ state: "open", sort: "newest" }, undefined, 1, signal)).open;
    },
    [isKept],
    EVERY_MS,
  );
  useEffect(() => {
    if (data !== undefined) inboxOpen.value = data;
  }, [data]);
}
