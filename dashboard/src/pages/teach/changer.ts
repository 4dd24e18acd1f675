import type { ChangeRequest } from "../../api/sets";

/** Does something to a set, tells it and lets it be undone; whether it was done. */
export type Changer = (change: ChangeRequest) => Promise<boolean>;
