import { useEffect, useRef, useState } from "preact/hooks";
import { FrameStream, POLICY, type StreamResult } from "../../api/stream";
import { probeSession } from "../../session";
import { text } from "../../texts/try";
import { Rate } from "./rate";

/** Frames are this wide at most: the model needs no more, and a phone's network is spared. */
const WIDTH_PX = 640;
/** The least time between two frames: a person sees no difference beyond that. */
const LEAST_MS = 100;
const FIRST_RETRY_MS = 1000;
const LONGEST_RETRY_MS = 10_000;

/** The last answer with the frame that it is of. */
export interface Seen {
  result: StreamResult;
  frame: Blob;
  perSecond: number;
  roundTripMs: number;
}

export interface Streaming {
  state: "off" | "connecting" | "open" | "broken";
  seen?: Seen;
  problem?: string;
}

type Grab = (maxWidth: number) => Promise<Blob | undefined>;

/** Streams what `grab` gives while `on`, one frame at a time: the next one leaves when the last was answered. */
export function useStream(on: boolean, grab: Grab, robot: string, explain: boolean): Streaming {
  const [streaming, setStreaming] = useState<Streaming>({ state: "off" });
  const stream = useRef<FrameStream>(undefined);
  const asked = useRef({ grab, explain });
  asked.current = { grab, explain };

  useEffect(() => stream.current?.explain(explain), [explain]);

  useEffect(() => {
    if (!on) {
      setStreaming((before) => ({ ...before, state: "off" }));
      return undefined;
    }
    let stopped = false;
    let timer: ReturnType<typeof setTimeout> | undefined;
    let retry = FIRST_RETRY_MS;
    const rate = new Rate();
    let sent: { frame: Blob; at: number } | undefined;

    const sendNext = async () => {
      if (stopped) return;
      const frame = await asked.current.grab(WIDTH_PX);
      if (!frame || document.hidden) {
        timer = setTimeout(() => void sendNext(), LEAST_MS);
        return;
      }
      sent = { frame, at: performance.now() };
      stream.current?.send(frame);
    };

    const connect = () => {
      setStreaming((before) => ({ ...before, state: "connecting" }));
      stream.current = new FrameStream(robot, asked.current.explain, {
        onHello: () => {
          retry = FIRST_RETRY_MS;
          setStreaming((before) => ({ ...before, state: "open", problem: undefined }));
        },
        onResult: (result) => {
          if (!sent) return;
          rate.add(performance.now(), performance.now() - sent.at);
          const seen = {
            result,
            frame: sent.frame,
            perSecond: rate.perSecond(),
            roundTripMs: rate.meanMs(),
          };
          setStreaming((before) => ({ ...before, seen, problem: undefined }));
        },
        onRefused: (problem) => setStreaming((before) => ({ ...before, problem })),
        onReady: () => {
          const wait = sent ? LEAST_MS - (performance.now() - sent.at) : 0;
          timer = setTimeout(() => void sendNext(), Math.max(0, wait));
        },
        onClose: (code, reason) => {
          if (stopped) return;
          // A refused handshake tells a page nothing; the session may have ended.
          void probeSession();
          const problem =
            code === POLICY ? text.streamRefused(reason || text.refusedWithout) : undefined;
          setStreaming((before) => ({ ...before, state: "broken", problem }));
          clearTimeout(timer);
          timer = setTimeout(connect, retry);
          retry = Math.min(retry * 2, LONGEST_RETRY_MS);
        },
      });
    };
    connect();
    return () => {
      stopped = true;
      clearTimeout(timer);
      stream.current?.close();
      stream.current = undefined;
    };
  }, [on, robot]);
  return streaming;
}
