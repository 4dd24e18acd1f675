import { useCallback, useEffect, useRef, useState } from "preact/hooks";
import { isAbort } from "../api/client";
import { signIns } from "../session";

/** A part of a long list. */
export interface Page<T> {
  total: number;
  items: T[];
  /** Where the next part begins; left out behind the last. */
  next?: string;
}

type LoadPage<T> = (after: string | undefined, signal: AbortSignal) => Promise<Page<T>>;

/** A long list as far as it was loaded, from its beginning. */
export interface Paged<T> {
  items: readonly T[];
  total: number;
  loading: boolean;
  error?: unknown;
  /** Loads as many items as it takes to have that one. */
  need: (index: number) => void;
  /** Loads all of them. */
  all: () => Promise<readonly T[]>;
  /** Loads again what was loaded. */
  reload: () => void;
}

interface State<T> {
  items: readonly T[];
  total: number;
  next?: string;
  loading: boolean;
  error?: unknown;
}

/** Whether a list is loaded as far as that. */
function reaches<T>(state: State<T>, index: number): boolean {
  return state.items.length > index || (state.next === undefined && !state.loading);
}

/**
 * Loads a long list part by part; from the beginning whenever `inputs` change. Whenever `version` changes, what was loaded is
 * loaded again.
 */
export function usePaged<T>(
  loadPage: LoadPage<T>,
  inputs: readonly unknown[],
  version = 0,
): Paged<T> {
  const [state, setState] = useState<State<T>>({ items: [], total: 0, loading: true });
  const [round, setRound] = useState(0);
  const latest = useRef({ state, loadPage, wanted: 0, running: Promise.resolve() });
  latest.current.loadPage = loadPage;
  const abort = useRef(new AbortController());

  const put = useCallback((next: State<T>) => {
    latest.current.state = next;
    setState(next);
  }, []);

  /** Loads behind `from` until what is wanted is there; what is there meanwhile stays in view. */
  const run = useCallback(async (from: State<T>, isFresh: boolean) => {
    const { signal } = abort.current;
    let state = from;
    try {
      do {
        const page = await latest.current.loadPage(state.next, signal);
        if (signal.aborted) return;
        const items = [...state.items, ...page.items];
        state = { items, total: page.total, next: page.next, loading: page.next !== undefined };
        if (!isFresh) put(state);
      } while (state.next !== undefined && state.items.length <= latest.current.wanted);
      put({ ...state, loading: false });
    } catch (error) {
      if (isAbort(error) || signal.aborted) return;
      put({ ...latest.current.state, loading: false, error });
    }
  }, []);

  useEffect(() => {
    abort.current = new AbortController();
    latest.current.wanted = 0;
    put({ items: [], total: 0, loading: true });
    latest.current.running = run({ items: [], total: 0, loading: true }, false);
    return () => abort.current.abort();
  }, [...inputs, signIns.value]);

  const reloads = useRef({ round, version });
  useEffect(() => {
    // The first time what is there is loaded anyway.
    if (reloads.current.round === round && reloads.current.version === version) return;
    reloads.current = { round, version };
    abort.current.abort();
    abort.current = new AbortController();
    latest.current.wanted = Math.max(latest.current.state.items.length - 1, 0);
    latest.current.running = run({ items: [], total: 0, loading: true }, true);
  }, [round, version]);

  const need = useCallback((index: number) => {
    latest.current.wanted = Math.max(latest.current.wanted, index);
    const { state } = latest.current;
    if (state.loading || state.error !== undefined || reaches(state, index)) return;
    put({ ...state, loading: true });
    latest.current.running = run(state, false);
  }, []);

  const all = useCallback(async () => {
    need(Infinity);
    await latest.current.running;
    // What was under way may have been started for less.
    if (!reaches(latest.current.state, Infinity) && latest.current.state.error === undefined) {
      need(Infinity);
      await latest.current.running;
    }
    return latest.current.state.items;
  }, []);

  const reload = useCallback(() => setRound((n) => n + 1), []);
  return { ...state, need, all, reload };
}
