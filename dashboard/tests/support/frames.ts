import { readdir } from "node:fs/promises";
import { join } from "node:path";
import { ROOMS_FOLDER } from "./paths";

/** The model that serves. */
export const MODEL = "lab";

/** Rooms that the model tells apart without fail. */
export const ROOM = "printer area";
export const OTHER_ROOM = "corridor";

/** The frames of a room, or of all with `*`, in the order in which they were taken. */
export async function framesOf(room: string, drive: string): Promise<string[]> {
  const rooms = room === "*" ? await readdir(ROOMS_FOLDER) : [room];
  const folders = rooms.map((name) => join(ROOMS_FOLDER, name, drive));
  const files = await Promise.all(
    folders.map(async (folder) => (await readdir(folder)).map((file) => ({ folder, file }))),
  );
  // Names begin with the time.
  const all = files.flat().sort((one, other) => (one.file < other.file ? -1 : 1));
  return all.map(({ folder, file }) => join(folder, file));
}

/** A picture in which nothing can be seen, as a PGM. */
export function darkness(shade = 0): Uint8Array {
  const head = new TextEncoder().encode("P5 160 120 255\n");
  const picture = new Uint8Array(head.length + 160 * 120).fill(shade);
  picture.set(head);
  return picture;
}
