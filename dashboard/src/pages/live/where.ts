import type { Robot } from "../../api/live";
import { text as common } from "../../texts/common";
import { text } from "../../texts/live";
import { entries } from "./store";

/** Robots that are connected, by the room that they are in. */
export function robotsByRoom(): Map<string, Robot[]> {
  const rooms = new Map<string, Robot[]>();
  for (const { robot } of entries.values()) {
    const one = robot.peek();
    if (!one.connected || !one.room) continue;
    const there = rooms.get(one.room);
    if (there) there.push(one);
    else rooms.set(one.room, [one]);
  }
  return rooms;
}

/** A robot in words, for those who do not see where it is drawn. */
export function told(robot: Robot): string {
  const state = robot.lost ? text.lost : robot.known ? common.known : common.notKnown;
  return text.robotIn(robot.id, robot.room ?? common.noRoom, state);
}
