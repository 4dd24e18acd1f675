import { execFile } from "node:child_process";
import { existsSync } from "node:fs";
import { copyFile, mkdir, readdir, readFile, rm, stat, writeFile } from "node:fs/promises";
import { join } from "node:path";
import { promisify } from "node:util";
import { framesOf, MODEL, ROOM } from "./frames";
import { MODELS_FOLDER, PREPARED, PROGRAM, ROOMS_FOLDER, SIMULATED, videoOf } from "./paths";

const run = promisify(execFile);

const DRIVES = ["cloudy1", "cloudy2"];

/** A film has 30 pictures a second: each frame stays for this many of them. */
const SLOWNESS = 6;

/** Makes what all tests use: frames of a lab that does not exist, a model, films for a camera that is none. */
export default async function setup(): Promise<void> {
  if (!existsSync(PROGRAM)) throw new Error(`${PROGRAM} is missing: cargo build --all-features`);
  await mkdir(PREPARED, { recursive: true });
  // What is there already is kept.
  await run(PROGRAM, [
    ...["simulate", SIMULATED, "--quiet", "--camera=std"],
    ...[`--illumination=${DRIVES.join(",")}`, "--frames-per-second=0.5"],
  ]);
  if (!existsSync(ROOMS_FOLDER)) await sortIntoRooms();
  await trainOnce();
  await film("walk", [...(await framesOf("*", "cloudy1")), ...(await framesOf("*", "cloudy2"))]);
  await film("room", (await framesOf(ROOM, "cloudy1")).slice(0, 1));
}

/** Lays the simulated frames out as people do: a folder a room, in it one a drive. */
async function sortIntoRooms(): Promise<void> {
  for (const drive of DRIVES) {
    const [sequence] = (await readdir(SIMULATED, { recursive: true })).filter((path) =>
      path.endsWith(`_${drive}`),
    );
    const folder = join(SIMULATED, sequence ?? "");
    const places = await readFile(join(folder, "localization/places.lst"), "utf8");
    for (const line of places.trim().split("\n")) {
      const [file = "", place = ""] = line.split(" ");
      const to = join(ROOMS_FOLDER, ROOM_NAMES[place] ?? place, drive);
      await mkdir(to, { recursive: true });
      await copyFile(join(folder, "std_cam", file), join(to, file));
    }
  }
}

/** What the model calls the places of the simulated lab. */
const ROOM_NAMES: Record<string, string> = {
  "1PO-B": "one-person office",
  "CR-B": "corridor",
  "PA-B": "printer area",
  "TL-B": "bathroom",
};

/** Trains anew where the program is another one. */
async function trainOnce(): Promise<void> {
  const stamp = join(PREPARED, "trained-by");
  const { size, mtimeMs } = await stat(PROGRAM);
  const program = `${PROGRAM} ${size} ${mtimeMs}`;
  if (existsSync(stamp) && (await readFile(stamp, "utf8")) === program) return;
  await rm(MODELS_FOLDER, { recursive: true, force: true });
  const model = join(MODELS_FOLDER, MODEL, "1");
  const how = ["--camera=perspective", "--effort=fast", "--quiet", "--output", model];
  await run(PROGRAM, ["train", SIMULATED, ...how]);
  await writeFile(stamp, program);
}

async function film(video: "walk" | "room", frames: string[]): Promise<void> {
  if (existsSync(videoOf(video))) return;
  const pictures = await Promise.all(frames.map((frame) => readFile(frame)));
  await writeFile(
    videoOf(video),
    Buffer.concat(pictures.flatMap((picture) => Array<Buffer>(SLOWNESS).fill(picture))),
  );
}
