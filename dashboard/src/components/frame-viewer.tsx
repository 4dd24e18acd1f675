import { text } from "../texts/frames";
import { Button } from "./button";
import { Dialog } from "./dialog";
import { Picture } from "./picture";

interface FrameViewerProps {
  names: readonly string[];
  index: number;
  picture: (name: string) => string;
  onGo: (index: number) => void;
  onClose: () => void;
}

/** A frame as large as it fits, and those before and after it. */
export function FrameViewer({ names, index, picture, onGo, onClose }: FrameViewerProps) {
  const name = names[index];
  if (name === undefined) return null;
  const step = (by: number) => {
    if (names[index + by] !== undefined) onGo(index + by);
  };
  const whenPressed = (event: KeyboardEvent) => {
    if (event.key === "ArrowLeft") step(-1);
    if (event.key === "ArrowRight") step(1);
  };
  return (
    <Dialog title={name} wide onClose={onClose} onKeyDown={whenPressed}>
      <div class="stack">
        <Picture class="enlarged" whole eager src={picture(name)} alt={text.frame(name)} />
        <div class="row">
          <Button disabled={index === 0} onClick={() => step(-1)}>
            {text.previous}
          </Button>
          <Button disabled={index === names.length - 1} onClick={() => step(1)}>
            {text.next}
          </Button>
          <span class="muted number">{text.position(index + 1, names.length)}</span>
        </div>
      </div>
    </Dialog>
  );
}
