/** Where the pictures of dropped folders belong: room and drive by their paths, as in `room/drive/file`. */

/** A picture and its path below what was dropped. */
export interface Pathed<Item> {
  readonly path: string;
  readonly item: Item;
}

export interface Placed<Item> {
  readonly room: string;
  readonly drive: string;
  readonly name: string;
  readonly item: Item;
}

/** What systems leave in folders. */
const LEFT_BY_SYSTEMS = /(^|\/)(\.|@eaDir|__MACOSX|Thumbs\.db$|desktop\.ini$)/i;

const folders = (path: string) => path.split("/").filter(Boolean).slice(0, -1);

/** Leaves out hidden files and what systems leave. */
export function pictures<Item>(files: readonly Pathed<Item>[]): Pathed<Item>[] {
  return files.filter(({ path }) => !LEFT_BY_SYSTEMS.test(path));
}

/** How many folders lie around the rooms: all pictures lie in them, and other folders in them. */
export function levelOfRooms(paths: readonly string[]): number {
  const all = paths.map(folders);
  const first = all[0] ?? [];
  let shared = 0;
  while (shared < first.length && all.every((names) => names[shared] === first[shared])) {
    shared += 1;
  }
  // Where nothing tells them apart, the innermost folder is the room.
  const shallowest = Math.min(...all.map((names) => names.length));
  return Math.max(Math.min(shared, shallowest - 1), 0);
}

/**
 * Places pictures by their folders: that at `level` is the room, what lies deeper the drive. Pictures that lie higher go to
 * `room`.
 */
export function placed<Item>(
  files: readonly Pathed<Item>[],
  level: number,
  room: string,
  drive: string,
): Placed<Item>[] {
  return files.map(({ path, item }) => {
    const names = folders(path);
    const deeper = names.slice(level + 1).join("-");
    const name = path.split("/").at(-1) ?? path;
    return { room: named(names[level] ?? room), drive: named(deeper || drive), name, item };
  });
}

/** A name for a room or a drive as the service takes it: a folder's name on any system. */
export function named(name: string): string {
  const plain = name.replaceAll(/[/\\:*?"<>|\p{Cc}]/gu, "-").trim();
  return trimmed(trimmed(plain).slice(0, 64)) || "unnamed";
}

const trimmed = (name: string) => name.replaceAll(/^[.\s]+|[.\s]+$/g, "");

/** Chunks of a few files of the same room and drive, none larger than `bytes` unless by a single file. */
export function chunks<Item>(
  files: readonly Placed<Item>[],
  size: (item: Item) => number,
  limits: { readonly files: number; readonly bytes: number },
): Placed<Item>[][] {
  const made: Placed<Item>[][] = [];
  let bytes = 0;
  for (const file of files) {
    const chunk = made.at(-1);
    const first = chunk?.[0];
    const isSame = first?.room === file.room && first.drive === file.drive;
    const fits = bytes + size(file.item) <= limits.bytes;
    if (chunk !== undefined && isSame && fits && chunk.length < limits.files) {
      chunk.push(file);
      bytes += size(file.item);
    } else {
      made.push([file]);
      bytes = size(file.item);
    }
  }
  return made;
}
