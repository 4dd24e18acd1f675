import { address } from "./client";

/** How a feed stands. */
export type FeedState = "connecting" | "open" | "polling" | "broken";

export interface FeedOptions {
  /** The call that sends events. */
  path: string;
  /** What to do with the data of an event of each name. */
  events: Record<string, (data: unknown) => void>;
  onState?: (state: FeedState) => void;
  /** Where events do not get through, as with a proxy that holds them back: called every two seconds instead. */
  poll?: () => Promise<void>;
}

const FIRST_RETRY_MS = 1000;
const LONGEST_RETRY_MS = 15_000;
const SILENCE_MS = 8000;
const POLL_MS = 2000;
const POLLS = 30;

/**
 * Reads server-sent events until it is stopped: reconnects where the connection breaks, and asks instead where no event
 * gets through. Browsers allow six connections to a service for all their tabs together, so a hidden tab holds none.
 */
export function openFeed(options: FeedOptions): () => void {
  let source: EventSource | undefined;
  let timer: ReturnType<typeof setTimeout> | undefined;
  let retry = FIRST_RETRY_MS;
  let silences = 0;
  let stopped = false;

  const tell = (state: FeedState) => options.onState?.(state);

  const close = () => {
    source?.close();
    source = undefined;
    clearTimeout(timer);
  };

  const again = () => {
    close();
    tell("broken");
    timer = setTimeout(connect, retry);
    retry = Math.min(retry * 2, LONGEST_RETRY_MS);
  };

  const ask = async (round = 0) => {
    try {
      await options.poll?.();
      if (stopped || document.hidden) return;
      tell("polling");
      // Now and then events are tried again.
      timer = setTimeout(() => (round < POLLS ? void ask(round + 1) : connect()), POLL_MS);
    } catch {
      if (!stopped && !document.hidden) again();
    }
  };

  const heard = () => {
    clearTimeout(timer);
    retry = FIRST_RETRY_MS;
    silences = 0;
    tell("open");
  };

  const connect = () => {
    if (stopped || document.hidden) return;
    tell("connecting");
    source = new EventSource(address(options.path));
    for (const [name, take] of Object.entries(options.events)) {
      source.addEventListener(name, (event: MessageEvent<string>) => {
        heard();
        take(JSON.parse(event.data));
      });
    }
    source.addEventListener("open", () => {
      if (!options.poll) heard();
    });
    source.addEventListener("error", () => {
      // It was refused: asking also tells whether the session has ended.
      const isRefused = source?.readyState === EventSource.CLOSED;
      close();
      if (options.poll && isRefused) void ask();
      else again();
    });
    if (options.poll) {
      timer = setTimeout(() => {
        silences += 1;
        close();
        if (silences >= 2) void ask();
        else connect();
      }, SILENCE_MS);
    }
  };

  const whenSeen = () => {
    close();
    if (!document.hidden) connect();
  };

  document.addEventListener("visibilitychange", whenSeen);
  connect();
  return () => {
    stopped = true;
    document.removeEventListener("visibilitychange", whenSeen);
    close();
  };
}
