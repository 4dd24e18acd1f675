import { inboxPicture, type Conflict } from "../../api/inbox";
import { Button } from "../../components/button";
import { Dialog } from "../../components/dialog";
import { Picture } from "../../components/picture";
import { text as common } from "../../texts/common";
import { text } from "../../texts/inbox";

interface ConflictsProps {
  conflicts: Conflict[];
  onShow: () => void;
  onClose: () => void;
}

/** Frames that somebody else has labeled in the meantime. */
export function Conflicts({ conflicts, onShow, onClose }: ConflictsProps) {
  return (
    <Dialog title={text.conflictsTitle(conflicts.length)} onClose={onClose}>
      <p>{text.conflictsText}</p>
      <ul class="conflicts">
        {conflicts.map(({ id, label, reason }) => (
          <li key={id}>
            <Picture src={inboxPicture(id, 160)} alt={reason} />
            <p>{label ? text.conflictBy(label.by, label.room, label.set) : reason}</p>
          </li>
        ))}
      </ul>
      <div class="dialog-foot">
        <Button onClick={onShow}>{text.showLabeled}</Button>
        <Button kind="primary" onClick={onClose}>
          {common.ok}
        </Button>
      </div>
    </Dialog>
  );
}
