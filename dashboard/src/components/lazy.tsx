import type { FunctionComponent } from "preact";
import { useEffect, useState } from "preact/hooks";
import { text as common } from "../texts/common";
import { Button } from "./button";
import { Busy, Note } from "./layout";

type Loader<P> = () => Promise<{ default: FunctionComponent<P> }>;

/** A component whose code is fetched when it is first shown. */
export function lazy<P extends object>(load: Loader<P>): FunctionComponent<P> {
  let loaded: FunctionComponent<P> | undefined;
  return function Lazy(props: P) {
    const [, setRound] = useState(0);
    const [failed, setFailed] = useState(false);
    const fetchIt = () => {
      setFailed(false);
      load().then(
        (module) => {
          loaded = module.default;
          setRound((n) => n + 1);
        },
        () => setFailed(true),
      );
    };
    useEffect(() => {
      if (!loaded) fetchIt();
    }, []);
    if (loaded) {
      const Component = loaded;
      return <Component {...props} />;
    }
    if (!failed) return <Busy />;
    return (
      <Note kind="bad">
        <p>{common.pageFailed}</p>
        <div class="row">
          <Button compact onClick={fetchIt}>
            {common.retry}
          </Button>
          <Button compact onClick={() => location.reload()}>
            {common.reload}
          </Button>
        </div>
      </Note>
    );
  };
}
