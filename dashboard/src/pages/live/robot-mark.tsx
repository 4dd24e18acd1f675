import type { Robot } from "../../api/live";
import { href } from "../../route";
import type { Point } from "./graph-layout";
import { told } from "./where";

/** A robot in a drawing, which leads to it: hollow where it is not known there, red where it is lost. */
export function RobotMark({ robot, at, size = 6 }: { robot: Robot; at: Point; size?: number }) {
  const state = robot.lost ? "lost" : robot.known ? "known" : "not-known";
  return (
    <a href={href("live", robot.id)} aria-label={told(robot)}>
      <circle class={`robot-mark ${state}`} cx={at.x} cy={at.y} r={size}>
        <title>{told(robot)}</title>
      </circle>
    </a>
  );
}
