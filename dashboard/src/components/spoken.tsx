import { useEffect, useState } from "preact/hooks";

const AFTER_MS = 1500;

/** Tells a screen reader something that changes often, once it has stayed the same for a moment. */
export function Spoken({ text }: { text: string }) {
  const [spoken, setSpoken] = useState("");
  useEffect(() => {
    const timer = setTimeout(() => setSpoken(text), AFTER_MS);
    return () => clearTimeout(timer);
  }, [text]);
  return (
    <p class="hidden" aria-live="polite">
      {spoken}
    </p>
  );
}
