import type { Robot } from "../../api/live";

/** What the cards of robots are chosen by. */
export interface Choice {
  search: string;
  state: "all" | "lost" | "unknown" | "left";
}

const rank = (robot: Robot) => (robot.lost && robot.connected ? 0 : robot.connected ? 1 : 2);

const names = new Intl.Collator("en", { numeric: true });

/** Lost robots first, those that left last; each by name, so that cards stay where they are. */
export function compareRobots(one: Robot, other: Robot): number {
  return rank(one) - rank(other) || names.compare(one.id, other.id);
}

/** Whether a robot's card is wanted. */
export function isChosen(robot: Robot, { search, state }: Choice): boolean {
  const wanted = search.trim().toLowerCase();
  const told = `${robot.id} ${robot.room ?? ""} ${robot.key ?? ""}`.toLowerCase();
  if (!told.includes(wanted)) return false;
  switch (state) {
    case "lost":
      return robot.lost;
    case "unknown":
      return robot.connected && !robot.known;
    case "left":
      return !robot.connected;
    default:
      return true;
  }
}
