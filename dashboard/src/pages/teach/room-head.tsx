import { useState } from "preact/hooks";
import type { DataSet } from "../../api/sets";
import { Button } from "../../components/button";
import { confirm, Dialog } from "../../components/dialog";
import { CompactSelect, TextField } from "../../components/fields";
import { blockedForData } from "../../session";
import { text as common } from "../../texts/common";
import { text } from "../../texts/teach";
import { named } from "./folders";
import type { Chosen } from "./room-list";
import type { Changer } from "./changer";

interface RoomHeadProps {
  set: DataSet;
  chosen: Chosen;
  change: Changer;
  onChoose: (chosen: Chosen) => void;
}

/** What is shown, and what can be done to all of a room or a drive. */
export function RoomHead({ set, chosen, change, onChoose }: RoomHeadProps) {
  const [renaming, setRenaming] = useState<"room" | "drive" | undefined>(undefined);
  const blocked = blockedForData("admin");
  const room = set.rooms.find(({ name }) => name === chosen.room);
  if (!room) return null;

  const rename = async (to: string) => {
    setRenaming(undefined);
    if (renaming === "drive" && chosen.drive !== undefined) {
      const { drive } = chosen;
      const done = await change({ action: "rename_drive", room: room.name, drive, to });
      if (done) onChoose({ room: room.name, drive: to });
    } else if (await change({ action: "rename_room", room: room.name, to })) {
      onChoose({ room: to });
    }
  };
  const remove = async () => {
    const question = {
      title: text.removeRoomTitle(room.name),
      text: text.removeRoomText(room.frames),
      action: text.removeRoom,
      danger: true,
    };
    if (await confirm(question)) {
      if (await change({ action: "remove_room", room: room.name })) onChoose({});
    }
  };
  const drives = room.drives.map(({ name, frames }) => ({
    value: name,
    label: `${name} (${frames})`,
  }));
  return (
    <div class="row">
      <h2 class="clip">{room.name}</h2>
      <CompactSelect
        label={text.drive}
        value={chosen.drive ?? ""}
        options={[{ value: "", label: `${text.allDrives} (${room.drives.length})` }, ...drives]}
        onChange={(drive) => onChoose({ room: room.name, drive: drive || undefined })}
      />
      <span class="grow" />
      {chosen.drive !== undefined && (
        <Button compact blocked={blocked} onClick={() => setRenaming("drive")}>
          {text.renameDrive}
        </Button>
      )}
      <Button compact blocked={blocked} onClick={() => setRenaming("room")}>
        {text.renameRoom}
      </Button>
      <Button compact icon="remove" blocked={blocked} onClick={() => void remove()}>
        {text.removeRoom}
      </Button>
      {renaming && (
        <RenameDialog
          title={renaming === "room" ? text.renameRoom : text.renameDrive}
          name={(renaming === "room" ? undefined : chosen.drive) ?? room.name}
          others={renaming === "room" ? set.rooms.map(({ name }) => name) : []}
          onRename={(to) => void rename(to)}
          onClose={() => setRenaming(undefined)}
        />
      )}
    </div>
  );
}

interface RenameDialogProps {
  title: string;
  name: string;
  /** Names of others, with which it would become one. */
  others: string[];
  onRename: (to: string) => void;
  onClose: () => void;
}

function RenameDialog({ title, name, others, onRename, onClose }: RenameDialogProps) {
  const [to, setTo] = useState(name);
  const isOther = to !== name && others.includes(to);
  const submit = (event: Event) => {
    event.preventDefault();
    if (to.trim() !== "" && to !== name) onRename(named(to));
  };
  return (
    <Dialog title={title} onClose={onClose}>
      <form class="stack" onSubmit={submit}>
        <TextField
          label={text.newName}
          hint={isOther ? text.mergeHint(to) : others.length > 0 ? text.renameHint : undefined}
          value={to}
          onInput={setTo}
          suggestions={others.length > 0 ? others : undefined}
          maxLength={64}
          required
          autoFocus
        />
        <div class="dialog-foot">
          <Button onClick={onClose}>{common.cancel}</Button>
          <Button kind="primary" type="submit" disabled={to.trim() === "" || to === name}>
            {text.rename}
          </Button>
        </div>
      </form>
    </Dialog>
  );
}
