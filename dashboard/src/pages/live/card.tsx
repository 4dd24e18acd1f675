import { useEffect } from "preact/hooks";
import { fetchFrame, type Robot } from "../../api/live";
import { ProbabilityBars } from "../../components/bars";
import { Badge } from "../../components/layout";
import { Verdict } from "../../components/verdict";
import { WrongButton } from "../../components/wrong";
import { decimal, duration, milliseconds } from "../../format";
import { href } from "../../route";
import { text } from "../../texts/live";
import { LastFrame } from "./last-frame";
import { RibbonBar } from "./ribbon-bar";
import { type Entry, now } from "./store";

/** The height of a card, which all share, so that a grid of them can be reckoned. */
export const CARD_HEIGHT = 264;
export const CARD_WIDTH = 300;

const N_BARS = 3;
const THUMBNAIL_PX = 320;

/** How a robot stands, where it is not simply there. */
export function StateBadge({ robot }: { robot: Robot }) {
  if (!robot.connected) return <Badge>{text.seenAgo(duration(robot.last_seen_s))}</Badge>;
  if (robot.lost) return <Badge kind="bad">{text.lostFor(duration(robot.lost_s))}</Badge>;
  return null;
}

/** What became of frames that were not looked at, reason by reason. */
export function droppedOf({ frames }: Robot): { total: number; reasons: [string, number][] } {
  const reasons = Object.entries(frames.dropped).filter(([, n]) => n > 0);
  return { total: reasons.reduce((sum, [, n]) => sum + n, 0), reasons };
}

/** How old its last answer is; where its frames are not dated, how long answering took. */
function Age({ robot: { age_ms, latency_ms } }: { robot: Robot }) {
  return age_ms === undefined || age_ms === null ? (
    <span title={text.latencyMore}>{text.latency(milliseconds(latency_ms))}</span>
  ) : (
    <span title={text.ageMore}>{text.age(milliseconds(age_ms))}</span>
  );
}

/** A robot at a glance. */
export function RobotCard({ entry, every }: { entry: Entry; every: number }) {
  useEffect(() => {
    entry.watchers += 1;
    return () => {
      entry.watchers -= 1;
    };
  }, [entry]);
  const robot = entry.robot.value;
  const dropped = droppedOf(robot);
  const state = robot.connected ? (robot.lost ? "lost" : "") : "left";
  return (
    <article class={`card robot-card ${state}`} aria-label={robot.id}>
      <header class="robot-head">
        <h2 class="small-head clip">
          <a href={href("live", robot.id)} title={robot.id}>
            {robot.id}
          </a>
        </h2>
        <StateBadge robot={robot} />
        {robot.service && <Badge>{robot.service}</Badge>}
        {robot.room && robot.connected && !robot.service && (
          <WrongButton
            frame={() => fetchFrame(robot.id)}
            answer={{ ...robot, room: robot.room }}
            robot={robot.robot ?? undefined}
            label={text.wrongOf(robot.room, robot.id)}
          />
        )}
      </header>
      <div class="robot-now">
        <LastFrame id={robot.id} every={every} width={THUMBNAIL_PX} class="robot-frame" />
        <Verdict {...robot} />
      </div>
      <ProbabilityBars probabilities={robot.probabilities} most={N_BARS} />
      <RibbonBar ribbon={entry.ribbon} now={now.peek()} />
      <footer class="robot-foot number">
        <span>{text.perSecond(decimal(robot.frames_per_s))}</span>
        <Age robot={robot} />
        <span
          title={dropped.reasons
            .map(([reason, n]) => `${n}: ${text.dropReasons[reason] ?? reason}`)
            .join("\n")}
        >
          {dropped.total > 0 ? text.dropped(dropped.total) : text.noneDropped}
        </span>
      </footer>
    </article>
  );
}
