import { useEffect, useRef, useState } from "preact/hooks";
import { text } from "./texts/common";

export interface CameraDevice {
  id: string;
  label: string;
}

export interface Camera {
  /** For the `<video>` that shows it. */
  video: { current: HTMLVideoElement | null };
  running: boolean;
  /** Why there is no picture. */
  problem?: string;
  devices: CameraDevice[];
  device?: string;
  start: (device?: string) => Promise<void>;
  stop: () => void;
  /** The picture of now as a JPEG at most so wide; undefined before the first one. */
  grab: (maxWidth: number) => Promise<Blob | undefined>;
}

const QUALITY = 0.85;

/** Why the browser gives this page no camera at all; undefined if it may. */
export function cameraMissing(): string | undefined {
  // The browser's type says that it is always there; over plain HTTP it is not.
  const devices = navigator.mediaDevices as MediaDevices | undefined;
  return window.isSecureContext && devices ? undefined : text.cameraInsecure;
}

/** The camera of the laptop or phone; it is let go when the page is left. */
export function useCamera(): Camera {
  const video = useRef<HTMLVideoElement>(null);
  const stream = useRef<MediaStream | undefined>(undefined);
  const canvas = useRef<HTMLCanvasElement | undefined>(undefined);
  const wanted = useRef(0);
  const [running, setRunning] = useState(false);
  const [problem, setProblem] = useState<string>();
  const [devices, setDevices] = useState<CameraDevice[]>([]);
  const [device, setDevice] = useState<string>();

  const release = () => {
    stream.current?.getTracks().forEach((track) => track.stop());
    stream.current = undefined;
  };

  const stop = () => {
    wanted.current += 1;
    release();
    if (video.current) video.current.srcObject = null;
    setRunning(false);
  };

  const start = async (id?: string) => {
    stop();
    const turn = wanted.current;
    const missing = cameraMissing();
    setProblem(missing);
    if (missing) return;
    try {
      const size = { width: { ideal: 1280 }, height: { ideal: 720 } };
      const which = id ? { deviceId: { exact: id } } : { facingMode: "environment" };
      const opened = await navigator.mediaDevices.getUserMedia({ video: { ...size, ...which } });
      if (turn !== wanted.current || !video.current) {
        opened.getTracks().forEach((track) => track.stop());
        return;
      }
      stream.current = opened;
      const track = opened.getVideoTracks()[0];
      track?.addEventListener("ended", stop);
      setDevice(track?.getSettings().deviceId);
      video.current.srcObject = opened;
      await video.current.play();
      setRunning(true);
      const all = await navigator.mediaDevices.enumerateDevices();
      const cameras = all.filter(({ kind }) => kind === "videoinput");
      setDevices(
        cameras.map(({ deviceId, label }, at) => ({
          id: deviceId,
          label: label || text.cameraNumber(at + 1),
        })),
      );
    } catch (error) {
      if (turn !== wanted.current) return;
      stop();
      setProblem(problemOf(error));
    }
  };

  const grab = async (maxWidth: number) => {
    const source = video.current;
    if (!source || source.readyState < HTMLMediaElement.HAVE_CURRENT_DATA) return undefined;
    const scale = Math.min(1, maxWidth / source.videoWidth);
    const target = (canvas.current ??= document.createElement("canvas"));
    target.width = Math.max(1, Math.round(source.videoWidth * scale));
    target.height = Math.max(1, Math.round(source.videoHeight * scale));
    target.getContext("2d")?.drawImage(source, 0, 0, target.width, target.height);
    return await new Promise<Blob | undefined>((resolve) =>
      target.toBlob((blob) => resolve(blob ?? undefined), "image/jpeg", QUALITY),
    );
  };

  useEffect(
    () => () => {
      wanted.current += 1;
      release();
    },
    [],
  );
  return { video, running, problem, devices, device, start, stop, grab };
}

function problemOf(error: unknown): string {
  const name = error instanceof DOMException ? error.name : "";
  switch (name) {
    case "NotAllowedError":
    case "SecurityError":
      return text.cameraDenied;
    case "NotFoundError":
    case "OverconstrainedError":
      return text.cameraNone;
    case "NotReadableError":
      return text.cameraBusy;
    default:
      return text.cameraFailed(error instanceof Error ? error.message : String(error));
  }
}
