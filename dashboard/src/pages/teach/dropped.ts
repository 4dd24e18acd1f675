/** Files and folders that were dropped on the page or chosen, with their paths. */

import { pictures, type Pathed } from "./folders";

export type DroppedFile = Pathed<File>;

/** Whether files are dragged, not frames of the page itself. */
export const hasFiles = (event: DragEvent) => event.dataTransfer?.types.includes("Files") ?? false;

const fileOf = (entry: FileSystemFileEntry) =>
  new Promise<File>((found, failed) => entry.file(found, failed));

const entriesOf = (reader: FileSystemDirectoryReader) =>
  new Promise<FileSystemEntry[]>((found, failed) => reader.readEntries(found, failed));

async function read(entry: FileSystemEntry, found: DroppedFile[]): Promise<void> {
  if (entry.isFile) {
    const item = await fileOf(entry as FileSystemFileEntry);
    found.push({ path: entry.fullPath.replace(/^\//, ""), item });
    return;
  }
  const reader = (entry as FileSystemDirectoryEntry).createReader();
  // Browsers name a hundred or so at a time.
  for (let some = await entriesOf(reader); some.length > 0; some = await entriesOf(reader)) {
    for (const one of some) await read(one, found);
  }
}

/** Reads what was dropped, folders with all that is in them, by name. */
export async function readDropped(transfer: DataTransfer): Promise<DroppedFile[]> {
  // The list is empty once the event is over: entries are taken before anything is awaited.
  const entries = [...transfer.items].map((item) => item.webkitGetAsEntry());
  const found: DroppedFile[] = [];
  for (const entry of entries) {
    if (entry) await read(entry, found);
  }
  return inOrder(found);
}

/** Files that were chosen by a field. */
export function chosen(files: FileList | null): DroppedFile[] {
  return inOrder(
    [...(files ?? [])].map((item) => ({ path: item.webkitRelativePath || item.name, item })),
  );
}

function inOrder(files: DroppedFile[]): DroppedFile[] {
  return pictures(files).sort((a, b) => (a.path < b.path ? -1 : 1));
}
