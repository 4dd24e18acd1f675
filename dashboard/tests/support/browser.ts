import { type Video, videoOf } from "./paths";

/** How the browser is started, with a film in the place of a camera. */
export function cameraOf(video: Video) {
  return {
    // One of the system: none is fetched.
    executablePath: process.env.CHROMIUM ?? "/usr/bin/chromium",
    args: [
      "--no-sandbox",
      "--use-fake-ui-for-media-stream",
      "--use-fake-device-for-media-stream",
      `--use-file-for-fake-video-capture=${videoOf(video)}`,
    ],
  };
}
