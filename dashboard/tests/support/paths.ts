import { join } from "node:path";

const ROOT = join(import.meta.dirname, "../../..");

/** The program that serves the page. */
export const PROGRAM = process.env.ROOMSIGHT ?? join(ROOT, "target/debug/roomsight");

/** What is made once, before the first test, and stays for the next run. */
export const PREPARED = join(ROOT, "target/page-tests");

/** Simulated drives through a lab that does not exist. */
export const SIMULATED = join(PREPARED, "simulated");

/** Their frames, as `room/drive/file`. */
export const ROOMS_FOLDER = join(PREPARED, "rooms");

/** A repository with one model, which was trained on them. */
export const MODELS_FOLDER = join(PREPARED, "models");

export type Video = "walk" | "room";

/** What a camera that is none shows: a walk through all rooms, or one room. */
export const videoOf = (video: Video) => join(PREPARED, `${video}.mjpeg`);
