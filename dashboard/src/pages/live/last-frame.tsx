import { useEffect, useRef, useState } from "preact/hooks";
import { fetchFrom, isAbort } from "../../api/client";
import { frameAddress } from "../../api/live";
import { useInView } from "../../hooks";
import { service } from "../../session";
import { text } from "../../texts/live";
import { entries } from "./store";

/** Frames asked for at once: a browser has six connections to a service, for all that it asks. */
const AT_ONCE = 3;

let underWay = 0;
const waiting: (() => void)[] = [];

async function inTurn<T>(task: () => Promise<T>): Promise<T> {
  if (underWay >= AT_ONCE) await new Promise<void>((resolve) => waiting.push(resolve));
  underWay += 1;
  try {
    return await task();
  } finally {
    underWay -= 1;
    waiting.shift()?.();
  }
}

/** The last frame of a robot, asked for while it is in view, if there is another, at most once in so many milliseconds. */
export function LastFrame(props: { id: string; every: number; width?: number; class?: string }) {
  const { id, every, width } = props;
  const { ref, inView } = useInView<HTMLDivElement>();
  const [shown, setShown] = useState<string>();
  const number = useRef<number | null | undefined>(undefined);

  useEffect(() => {
    if (!inView) return undefined;
    const abort = new AbortController();
    let busy = false;
    const load = async () => {
      const newest = entries.get(id)?.robot.peek().frame;
      if (busy || document.hidden || newest === undefined || newest === null) return;
      if (newest === number.current) return;
      busy = true;
      try {
        const options = { signal: abort.signal, headers: { Accept: "image/*" } };
        const blob = await inTurn(async () =>
          abort.signal.aborted
            ? undefined
            : await (await fetchFrom(frameAddress(id, width), options)).blob(),
        );
        if (!blob || abort.signal.aborted) return;
        number.current = newest;
        setShown(URL.createObjectURL(blob));
      } catch (error) {
        // The next frame may come through; what is seen until then is the one before.
        if (!isAbort(error)) number.current = newest;
      } finally {
        busy = false;
      }
    };
    void load();
    const timer = setInterval(() => void load(), every);
    return () => {
      clearInterval(timer);
      abort.abort();
    };
  }, [id, inView, every, width]);

  useEffect(
    () => () => {
      if (shown) URL.revokeObjectURL(shown);
    },
    [shown],
  );

  const missing = service.value?.frames_kept === false ? text.framesNotKept : text.noFrame;
  return (
    <div ref={ref} class={`picture ${props.class ?? ""}`}>
      {shown ? (
        <img src={shown} alt={text.frameOf(id)} draggable={false} />
      ) : (
        <span class="missing">{missing}</span>
      )}
    </div>
  );
}
