import { useMemo } from "preact/hooks";
import type { MapPosition } from "../../api/models";
import { EmptyState } from "../../components/layout";
import { middles, PositionMap } from "../../components/position-map";
import { text } from "../../texts/live";
import { around } from "./graph-layout";
import { RobotMark } from "./robot-mark";
import { robotsByRoom } from "./where";

/** The map of training frames with the robots on it. */
export function LiveMap({ positions }: { positions: MapPosition[] }) {
  const rooms = useMemo(() => middles(positions), [positions]);
  if (positions.length === 0) {
    return <EmptyState icon="models" title={text.noPositions} text={text.noPositionsMore} />;
  }
  const robots = robotsByRoom();
  return (
    <figure class="graph-figure">
      <PositionMap positions={positions} label={text.positions}>
        {(place) =>
          rooms.flatMap(({ room, x, y }) => {
            const here = robots.get(room) ?? [];
            const middle = place(x, y);
            const seats = around(here.length, 8, 17);
            return here.map((robot, n) => {
              const seat = seats[n] ?? { x: 0, y: 0 };
              const at = robot.pose
                ? place(robot.pose.x, robot.pose.y)
                : { x: middle.x + seat.x, y: middle.y + seat.y };
              return <RobotMark key={robot.id} robot={robot} at={at} size={7} />;
            });
          })
        }
      </PositionMap>
      <figcaption class="muted small">{text.positionsMore}</figcaption>
    </figure>
  );
}
