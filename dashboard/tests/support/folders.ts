import { copyFile, mkdir, mkdtemp, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { dirname, join } from "node:path";

/** Copies pictures to paths in a folder, as a person would who has no page. */
export async function layOut(folder: string, pictures: Record<string, string>): Promise<void> {
  for (const [path, picture] of Object.entries(pictures)) {
    await mkdir(join(folder, dirname(path)), { recursive: true });
    await copyFile(picture, join(folder, path));
  }
}

export const temporaryFolder = () => mkdtemp(join(tmpdir(), "roomsight-folder-"));

export const removeFolder = (folder: string) => rm(folder, { recursive: true, force: true });
