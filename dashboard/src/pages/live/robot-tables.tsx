import type { PastAnswer, Robot, RobotInfo } from "../../api/live";
import { Table } from "../../components/table";
import { count, decimal, duration, milliseconds, percent } from "../../format";
import { roomClass } from "../../rooms";
import { text } from "../../texts/live";
import { droppedOf } from "./card";
import { RibbonBar } from "./ribbon-bar";
import { RIBBON_MS } from "./ribbon";
import { type Entry, now } from "./store";

/** The rooms of the last minutes, with their names. */
export function Past({ entry }: { entry: Entry }) {
  const rooms = [...new Set(entry.ribbon.map(({ room }) => room))];
  return (
    <section class="card padded stack" aria-label={text.pastTitle}>
      <h2>{text.pastTitle}</h2>
      <div>
        <RibbonBar ribbon={entry.ribbon} now={now.peek()} height={28} />
        <div class="ribbon-ends" aria-hidden="true">
          <span>{text.minutesAgo(RIBBON_MS / 60_000)}</span>
          <span>{text.minutesAgo(RIBBON_MS / 120_000)}</span>
          <span>{text.now}</span>
        </div>
      </div>
      <ul class="legend">
        {rooms.map((room) => (
          <li key={room} class={roomClass(room)}>
            <span class="dot" aria-hidden="true" />
            {room}
          </li>
        ))}
      </ul>
    </section>
  );
}

/** The robot in numbers. */
export function Numbers({ robot, info }: { robot: Robot; info: RobotInfo | undefined }) {
  const { numbers } = text;
  const dropped = droppedOf(robot);
  const rows: [string, string | undefined | null][] = [
    [numbers.model, robot.model && `${robot.model.name}/${robot.model.version}`],
    [numbers.via, robot.via === "rest" ? text.viaRest : text.viaStream],
    [numbers.service, robot.service],
    [numbers.key, robot.key],
    [numbers.mode, info?.mode],
    [numbers.streaming, info?.streaming_s ? duration(info.streaming_s) : undefined],
    [numbers.inRoom, duration(robot.in_room_s)],
    [numbers.rate, decimal(robot.frames_per_s)],
    [numbers.age, robot.age_ms ? milliseconds(robot.age_ms) : undefined],
    [numbers.latency, milliseconds(robot.latency_ms)],
    [numbers.accepted, count(robot.frames.accepted)],
    [numbers.results, count(robot.frames.results)],
    [numbers.errors, count(robot.frames.errors)],
    [numbers.dropped, count(dropped.total)],
    ...dropped.reasons.map(([reason, n]): [string, string] => [
      text.dropReasons[reason] ?? reason,
      count(n),
    ]),
  ];
  return (
    <section class="card padded stack" aria-label={text.numbersTitle}>
      <h2>{text.numbersTitle}</h2>
      <dl class="numbers number">
        {rows.map(
          ([name, value]) =>
            value && [<dt key={`${name}-name`}>{name}</dt>, <dd key={name}>{value}</dd>],
        )}
      </dl>
    </section>
  );
}

/** The last answers, the newest first. */
export function PastAnswers({ answers }: { answers: PastAnswer[] }) {
  if (answers.length === 0) return null;
  return (
    <section class="stack" aria-label={text.answersTitle}>
      <h2>{text.answersTitle}</h2>
      <Table
        label={text.answersTitle}
        head={[text.seq, text.room, text.known, text.probability, text.total, text.ago]}
        numbers={[0, 3, 4, 5]}
        rows={answers.map(({ seq, room, known, probability, timings_ms: ms, ago_s }) => ({
          key: String(seq),
          cells: [
            seq,
            room,
            known ? text.yes : text.no,
            percent(probability),
            milliseconds(ms.queue + ms.decode + ms.features + ms.classify),
            duration(ago_s),
          ],
        }))}
      />
    </section>
  );
}
