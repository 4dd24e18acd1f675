import { signal } from "@preact/signals";

/** How many frames wait in the inbox, for the navigation; whoever hears of it says so. */
export const inboxOpen = signal(0);
