/** What a frame of a browser that keeps up takes, in milliseconds, and some. */
const QUICK_MS = 20;
const LEAST_MS = 1000;
const MOST_MS = 5000;
/** How much of what was measured before counts on. */
const MEMORY = 0.8;

/** How often small changes are drawn: the slower the browser comes to its frames, the more seldom. */
export class Pace {
  #delay = 0;

  /** A frame came so many milliseconds after it was asked for. */
  waited(ms: number): void {
    this.#delay = MEMORY * this.#delay + (1 - MEMORY) * ms;
  }

  /** The time between two drawings of the same robot. */
  everyMs(): number {
    return Math.min(MOST_MS, Math.max(LEAST_MS, (LEAST_MS * this.#delay) / QUICK_MS));
  }
}
