/** A stretch of time that a robot spent in one room, in milliseconds since 1970 by the service's clock. */
export interface Stretch {
  room: string;
  known: boolean;
  from: number;
  until: number;
}

/** How much of the past a ribbon shows. */
export const RIBBON_MS = 10 * 60_000;

/** Answers this far apart leave a gap: nobody knows where the robot was. */
const GAP_MS = 15_000;

/** A ribbon that goes on with an answer at a time: the room's stretch grows, or another begins. */
export function extended(
  ribbon: readonly Stretch[],
  answer: { room: string; known: boolean },
  at: number,
): Stretch[] {
  // A clock that was set back takes what lies after it along.
  const kept = ribbon.filter(({ from, until }) => from <= at && until > at - RIBBON_MS);
  const last = kept.at(-1);
  const goesOn = last && at - last.until <= GAP_MS;
  if (goesOn && last.room === answer.room && last.known === answer.known) {
    return [...kept.slice(0, -1), { ...last, until: at }];
  }
  if (goesOn) kept[kept.length - 1] = { ...last, until: at };
  return [...kept, { ...answer, from: at, until: at }];
}

/** What is drawn of a ribbon whose right end is `now`: shares of its width. */
export function drawn(ribbon: readonly Stretch[], now: number, span = RIBBON_MS) {
  const begin = now - span;
  return ribbon
    .filter(({ from, until }) => until > begin && from <= now)
    .map((stretch) => {
      const left = Math.max(0, (stretch.from - begin) / span);
      const right = Math.min(1, (stretch.until - begin) / span);
      return { stretch, left, width: Math.max(0, right - left) };
    });
}
