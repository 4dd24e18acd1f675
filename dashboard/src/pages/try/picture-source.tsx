import { useEffect, useRef, useState } from "preact/hooks";
import { recognize } from "../../api/recognize";
import { Button } from "../../components/button";
import { chosenOf, EvidenceLegend, ExplainedFrame } from "../../components/explained";
import { Icon } from "../../components/icons";
import { Busy, ErrorNote } from "../../components/layout";
import { useLoad } from "../../hooks";
import { blockedFor } from "../../session";
import { text } from "../../texts/try";
import { AnswerView, Reasons } from "./answer-view";

interface Chosen {
  frame: Blob;
  name: string;
  url: string;
}

/** A picture that is dropped, chosen or pasted, and its answer. */
export function PictureSource() {
  const [chosen, setChosen] = useState<Chosen>();
  const take = (file: File | undefined) => {
    if (file)
      setChosen({ frame: file, name: file.name || text.pasted, url: URL.createObjectURL(file) });
  };
  useEffect(
    () => () => {
      if (chosen) URL.revokeObjectURL(chosen.url);
    },
    [chosen],
  );
  useEffect(() => {
    const paste = (event: ClipboardEvent) => take(event.clipboardData?.files[0]);
    document.addEventListener("paste", paste);
    return () => document.removeEventListener("paste", paste);
  }, []);
  return chosen ? <PictureAnswer chosen={chosen} onTake={take} /> : <DropZone onTake={take} />;
}

/** Whatever takes a dropped file: its class while one is over it, and its handlers. */
function useDrop(onTake: (file: File | undefined) => void) {
  const [over, setOver] = useState(false);
  return {
    over,
    handlers: {
      onDragOver: (event: DragEvent) => {
        event.preventDefault();
        setOver(true);
      },
      onDragLeave: () => setOver(false),
      onDrop: (event: DragEvent) => {
        event.preventDefault();
        setOver(false);
        onTake(event.dataTransfer?.files[0]);
      },
    },
  };
}

function FileButton(props: {
  label: string;
  primary?: boolean;
  onTake: (file: File | undefined) => void;
}) {
  const input = useRef<HTMLInputElement>(null);
  return (
    <>
      <Button
        kind={props.primary ? "primary" : undefined}
        icon="picture"
        blocked={blockedFor("robot")}
        onClick={() => input.current?.click()}
      >
        {props.label}
      </Button>
      <input
        ref={input}
        type="file"
        accept="image/*"
        hidden
        onChange={({ currentTarget }) => {
          props.onTake(currentTarget.files?.[0]);
          currentTarget.value = "";
        }}
      />
    </>
  );
}

function DropZone({ onTake }: { onTake: (file: File | undefined) => void }) {
  const drop = useDrop(onTake);
  return (
    <div class={`card drop-zone ${drop.over ? "over" : ""}`} {...drop.handlers}>
      <Icon name="picture" size={48} />
      <h2>{text.drop}</h2>
      <p class="muted">{text.dropMore}</p>
      <FileButton label={text.choose} primary onTake={onTake} />
    </div>
  );
}

function PictureAnswer(props: { chosen: Chosen; onTake: (file: File | undefined) => void }) {
  const { chosen, onTake } = props;
  const [nearest, setNearest] = useState<string>();
  const drop = useDrop(onTake);
  const { data, error, loading, reload } = useLoad(
    (signal) => recognize(chosen.frame, { explain: true, signal }),
    [chosen],
  );
  // While the next picture is looked at, the answer to the one before does not stand beside it.
  const answer = loading ? undefined : data;
  const shared = chosenOf(answer, nearest);
  return (
    <div class="try-panes" {...drop.handlers}>
      <div class={`card padded stack ${drop.over ? "drop-over" : ""}`}>
        <ExplainedFrame
          key={chosen.url}
          src={chosen.url}
          alt={text.pictureOf(chosen.name)}
          answer={answer}
          shared={shared}
        />
        <div class="row">
          <FileButton label={text.another} onTake={onTake} />
          <span class="muted small clip">{chosen.name}</span>
          <span class="grow" />
          {answer && <EvidenceLegend shared={shared !== undefined} />}
        </div>
      </div>
      <div class="stack" aria-live="polite">
        {loading && <Busy label={text.looking} />}
        {error !== undefined && !loading && <ErrorNote error={error} onRetry={reload} />}
        {answer && error === undefined && (
          <>
            <AnswerView answer={answer} frame={chosen.frame} />
            <Reasons answer={answer} chosen={nearest} onChoose={setNearest} />
          </>
        )}
      </div>
    </div>
  );
}
