import { batch, type Signal, signal } from "@preact/signals";
import { type FeedState, openFeed } from "../../api/feed";
import { type LiveMessage, listRobots, type Robot, type RobotInfo } from "../../api/live";
import { Pace } from "./pace";
import { extended, type Stretch } from "./ribbon";

/** One robot, as the page keeps it. */
export interface Entry {
  robot: Signal<Robot>;
  ribbon: Stretch[];
  /** How many parts of the page show it now. */
  watchers: number;
  /** When it was drawn last, by the browser's clock. */
  drawnAt: number;
}

/** At most so many robots in view are drawn anew in one animation frame. */
const DRAWN_A_FRAME = 4;

/** All robots by id. */
export const entries = new Map<string, Entry>();

/** Counts the changes of who there is, who is lost and who is where: lists and graphs follow it. */
export const changes = signal(0);

export const feedState = signal<FeedState>("connecting");

/** Changes that were not told, since this page or its network was too slow. */
export const lostEvents = signal(0);

/** The service's clock, as the last message had it. */
export const now = signal(0);

const pending = new Map<string, Robot>();
const pace = new Pace();
let frame = 0;
let timer: ReturnType<typeof setTimeout> | undefined;

/** What lists and graphs show of a robot. */
const summary = ({ room, known, lost, connected }: Robot) =>
  [room, known, lost, connected].join("\n");

function show(robot: Robot): void {
  const entry = entries.get(robot.id);
  if (!entry) {
    entries.set(robot.id, {
      robot: signal(robot),
      ribbon: ribbonAfter([], robot),
      watchers: 0,
      drawnAt: 0,
    });
    changes.value += 1;
    return;
  }
  entry.ribbon = ribbonAfter(entry.ribbon, robot);
  const before = entry.robot.peek();
  entry.robot.value = robot;
  if (summary(before) !== summary(robot)) changes.value += 1;
}

function ribbonAfter(ribbon: Stretch[], robot: Robot): Stretch[] {
  if (!robot.room || !robot.connected) return ribbon;
  const { room, known } = robot;
  return extended(ribbon, { room, known }, now.peek() - robot.last_seen_s * 1000);
}

/**
 * Shows what came since the last animation frame. A robot in view that changed its room is shown at once; one whose
 * numbers alone changed about once a second; where many are in view, over several frames.
 */
function flush(at: number): void {
  frame = 0;
  let left = DRAWN_A_FRAME;
  batch(() => {
    for (const [id, robot] of pending) {
      const entry = entries.get(id);
      if (entry && entry.watchers > 0) {
        const isSmall = summary(entry.robot.peek()) === summary(robot);
        if (isSmall && at - entry.drawnAt < pace.everyMs()) continue;
        if (left === 0) continue;
        left -= 1;
        entry.drawnAt = at;
      }
      pending.delete(id);
      show(robot);
    }
  });
  if (left === 0) flushSoon();
  else if (pending.size > 0) {
    clearTimeout(timer);
    timer = setTimeout(flushSoon, pace.everyMs());
  }
}

function flushSoon(): void {
  if (frame !== 0) return;
  const asked = performance.now();
  frame = requestAnimationFrame((at) => {
    pace.waited(performance.now() - asked);
    flush(at);
  });
}

function take(message: LiveMessage, isAll: boolean): void {
  now.value = Date.parse(message.at);
  lostEvents.value += message.lost_events;
  for (const robot of message.robots) pending.set(robot.id, robot);
  const there = new Set(message.robots.map(({ id }) => id));
  const gone = isAll ? [...entries.keys()].filter((id) => !there.has(id)) : message.gone;
  for (const id of gone) {
    pending.delete(id);
    if (entries.delete(id)) changes.value += 1;
  }
  flushSoon();
}

function takePast(robots: RobotInfo[]): void {
  for (const { id, ribbon } of robots) {
    const entry = entries.get(id);
    if (!entry || !ribbon) continue;
    const past = ribbon.map((part) => ({
      ...part,
      from: Date.parse(part.from),
      until: Date.parse(part.until),
    }));
    entry.ribbon = past;
    entry.robot.value = { ...entry.robot.peek() };
  }
}

/** Asks for all robots with their past. */
async function ask(): Promise<void> {
  const robots = await listRobots();
  take({ at: new Date().toISOString(), robots, gone: [], lost_events: 0 }, true);
}

/** Follows the robots until it is stopped. */
export function follow(): () => void {
  let isFirst = true;
  lostEvents.value = 0;
  const stop = openFeed({
    path: "v1/live?scope=fleet",
    events: {
      live: (data) => {
        take(data as LiveMessage, isFirst);
        // The rooms before this page was opened: asked for once all robots are there.
        if (isFirst) requestAnimationFrame(() => void listRobots().then(takePast, () => undefined));
        isFirst = false;
      },
    },
    onState: (state) => {
      if (state === "connecting") isFirst = true;
      feedState.value = state;
    },
    poll: ask,
  });
  return () => {
    stop();
    cancelAnimationFrame(frame);
    clearTimeout(timer);
    frame = 0;
    pending.clear();
  };
}
