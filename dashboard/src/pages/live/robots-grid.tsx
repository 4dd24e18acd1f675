import { useMemo } from "preact/hooks";
import { Button } from "../../components/button";
import { EmptyState } from "../../components/layout";
import { VirtualGrid } from "../../components/virtual";
import { useSeldom } from "../../hooks";
import { text } from "../../texts/live";
import { CARD_HEIGHT, CARD_WIDTH, RobotCard } from "./card";
import { type Choice, compareRobots, isChosen } from "./order";
import { changes, type Entry, entries } from "./store";

/** With more robots than this a frame is asked for every two seconds only. */
const MANY = 16;
const OFTEN_MS = 1000;
const SELDOM_MS = 2000;
const SORTED_EVERY_MS = 2000;

/** The cards of all robots that are chosen, the lost ones first. */
export function RobotsGrid({ choice, onShowAll }: { choice: Choice; onShowAll: () => void }) {
  // Cards that jumped about at every change could not be read.
  const round = useSeldom(changes.value, SORTED_EVERY_MS);
  const shown = useMemo(
    () =>
      [...entries.values()]
        .filter(({ robot }) => isChosen(robot.peek(), choice))
        .sort((one, other) => compareRobots(one.robot.peek(), other.robot.peek())),
    [round, choice],
  );
  if (shown.length === 0) {
    return (
      <EmptyState icon="search" title={text.noneChosen} text={text.noneChosenMore}>
        <Button onClick={onShowAll}>{text.showAll}</Button>
      </EmptyState>
    );
  }
  const every = entries.size > MANY ? SELDOM_MS : OFTEN_MS;
  return (
    <VirtualGrid<Entry>
      items={shown}
      keyOf={({ robot }) => robot.peek().id}
      render={(entry) => <RobotCard entry={entry} every={every} />}
      minWidth={CARD_WIDTH}
      rowHeight={CARD_HEIGHT}
      label={text.robots}
    />
  );
}
