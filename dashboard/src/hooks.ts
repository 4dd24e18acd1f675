import { useCallback, useEffect, useLayoutEffect, useRef, useState } from "preact/hooks";
import { isAbort } from "./api/client";
import { session, signIns } from "./session";

export interface Loaded<T> {
  /** What was loaded last; kept while it is loaded again. */
  data?: T;
  error?: unknown;
  loading: boolean;
  reload: () => void;
  /** Puts another value in its place, such as one that a change answered with. */
  set: (data: T) => void;
}

/**
 * Loads something, again whenever `inputs` change and after signing in; what is under way then is cancelled.
 * With `every` it is also loaded again after so many milliseconds, while the page is in view.
 */
export function useLoad<T>(
  load: (signal: AbortSignal) => Promise<T>,
  inputs: readonly unknown[],
  every?: number,
): Loaded<T> {
  const [state, setState] = useState<{ data?: T; error?: unknown; loading: boolean }>({
    loading: true,
  });
  const [round, setRound] = useState(0);
  const latest = useRef(load);
  latest.current = load;

  useEffect(() => {
    const abort = new AbortController();
    setState((before) => ({ ...before, loading: true }));
    latest
      .current(abort.signal)
      .then((data) => {
        if (!abort.signal.aborted) setState({ data, loading: false });
      })
      .catch((error: unknown) => {
        if (isAbort(error) || abort.signal.aborted) return;
        setState((before) => ({ data: before.data, error, loading: false }));
      });
    return () => abort.abort();
  }, [...inputs, round, signIns.value]);

  useEffect(() => {
    if (!every) return undefined;
    const timer = setInterval(() => {
      if (!document.hidden && session.peek().kind === "in") setRound((n) => n + 1);
    }, every);
    return () => clearInterval(timer);
  }, [every]);

  const reload = useCallback(() => setRound((n) => n + 1), []);
  const set = useCallback((data: T) => setState({ data, loading: false }), []);
  return { ...state, reload, set };
}

/** Runs an action of a person, one at a time: whether it is under way, and what went wrong. */
export function useAction<A extends unknown[]>(action: (...args: A) => Promise<void>) {
  const [state, setState] = useState<{ busy: boolean; error?: unknown }>({ busy: false });
  const busy = useRef(false);
  const run = async (...args: A) => {
    if (busy.current) return;
    busy.current = true;
    setState({ busy: true });
    try {
      await action(...args);
      setState({ busy: false });
    } catch (error) {
      setState({ busy: false, error });
    } finally {
      busy.current = false;
    }
  };
  const clear = () => setState({ busy: false });
  return { ...state, run, clear };
}

/** The width of an element in pixels, as it changes; 0 before it is there. */
export function useWidth<E extends Element>() {
  const ref = useRef<E>(null);
  const [width, setWidth] = useState(0);
  useLayoutEffect(() => {
    const element = ref.current;
    if (!element) return undefined;
    const measure = () => setWidth(Math.round(element.getBoundingClientRect().width));
    measure();
    const observer = new ResizeObserver(measure);
    observer.observe(element);
    return () => observer.disconnect();
  }, []);
  return { ref, width };
}

/** A value that changes often, at most once in so many milliseconds. */
export function useSeldom<T>(value: T, every: number): T {
  const [shown, setShown] = useState(value);
  const newest = useRef(value);
  newest.current = value;
  const timer = useRef<ReturnType<typeof setTimeout>>(undefined);
  const shownAt = useRef(0);
  useEffect(() => {
    if (Object.is(value, shown) || timer.current !== undefined) return;
    const wait = Math.max(0, shownAt.current + every - performance.now());
    timer.current = setTimeout(() => {
      timer.current = undefined;
      shownAt.current = performance.now();
      setShown(newest.current);
    }, wait);
  }, [value, shown, every]);
  useEffect(() => () => clearTimeout(timer.current), []);
  return shown;
}

/** Whether an element is in view, or almost. */
export function useInView<E extends Element>() {
  const ref = useRef<E>(null);
  const [inView, setInView] = useState(false);
  useEffect(() => {
    const element = ref.current;
    if (!element) return undefined;
    const observer = new IntersectionObserver(
      (entries) => setInView(entries.at(-1)?.isIntersecting ?? false),
      { rootMargin: "100px" },
    );
    observer.observe(element);
    return () => observer.disconnect();
  }, []);
  return { ref, inView };
}
