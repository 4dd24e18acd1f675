import { useEffect, useState } from "preact/hooks";
import { text as common } from "../texts/common";

const TRIES = 3;
const PAUSE_MS = 1200;

/** A picture that is asked for again where it did not come, and says so where it does not come at all. */
export function Picture(props: {
  src: string | undefined;
  alt: string;
  /** Show all of it instead of filling the frame. */
  whole?: boolean;
  class?: string;
  /** Asked for at once, not when it comes near the view. */
  eager?: boolean;
}) {
  const [tries, setTries] = useState(0);
  const [failed, setFailed] = useState(false);
  useEffect(() => {
    setTries(0);
    setFailed(false);
  }, [props.src]);
  useEffect(() => {
    if (!failed || tries >= TRIES) return undefined;
    const timer = setTimeout(
      () => {
        setTries(tries + 1);
        setFailed(false);
      },
      PAUSE_MS * 2 ** tries,
    );
    return () => clearTimeout(timer);
  }, [failed, tries]);
  const classes = ["picture", props.whole && "whole", props.class].filter(Boolean).join(" ");
  return (
    <div class={classes}>
      {props.src && !failed ? (
        <img
          key={tries}
          src={props.src}
          alt={props.alt}
          loading={props.eager ? "eager" : "lazy"}
          decoding="async"
          draggable={false}
          onError={() => setFailed(true)}
        />
      ) : (
        <span class="missing" role="img" aria-label={`${props.alt}: ${common.pictureMissing}`}>
          {common.pictureMissing}
        </span>
      )}
    </div>
  );
}
