import { useEffect, useRef, useState } from "preact/hooks";
import { addFrames } from "../../api/sets";
import type { Camera } from "../../camera";
import { judge } from "./judge";
import { considered, driveName, EMPTY, type Decision, type Recording } from "./recording";
import { Sender, type SenderState } from "./sender";
import { viewOf, type Pixels } from "./view";

/** How often the camera is looked at. */
const LOOK_MS = 120;
/** So many pictures wait at most; while they do none is taken. */
const CAPACITY = 8;
/** Frames are kept at this width: more is not looked at by default. */
const WIDTH = 1280;
const SMALL_WIDTH = 160;

interface Taken {
  name: string;
  picture: Blob;
}

export interface Recorder {
  /** Frames that were taken of this walk. */
  taken: number;
  /** What became of the frame that was looked at last; `waiting` where pictures are still on their way. */
  said?: Decision | "waiting";
  sending: SenderState;
  refused: { count: number; reason: string };
  drive: string;
  /** Whether frames are taken at the moment. */
  isTaking: boolean;
  setTaking: (isTaking: boolean) => void;
  /** Goes on with what could not be sent. */
  resume: () => void;
  /** Takes no more; resolves to the number of frames that are kept, once all are. */
  finish: () => Promise<number>;
}

/** Looks at the camera, and sends each frame that shows another view to a drive through the room. */
export function useRecorder(set: string, room: string, camera: Camera): Recorder {
  const [isTaking, setTaking] = useState(false);
  const [said, setSaid] = useState<Recorder["said"]>(undefined);
  const [taken, setCount] = useState(0);
  const [refused, setRefused] = useState({ count: 0, reason: "" });
  const [drive] = useState(() => driveName(new Date()));
  const [sending, setSending] = useState<SenderState>({ waiting: 0, sent: 0 });
  const recording = useRef<Recording>(EMPTY);
  const small = useRef<HTMLCanvasElement | undefined>(undefined);
  const latest = useRef(camera);
  latest.current = camera;
  // What ends needs them as they are, not as they were drawn last.
  const looking = useRef<Promise<void> | undefined>(undefined);
  const isFinished = useRef(false);
  const dropped = useRef(0);

  const refuse = (reason: string) => {
    dropped.current += 1;
    setRefused({ count: dropped.current, reason });
  };

  const sender = useRef<Sender<Taken> | undefined>(undefined);
  sender.current ??= new Sender<Taken>({
    capacity: CAPACITY,
    judge,
    changed: setSending,
    dropped: (_, reason) => refuse(reason),
    send: async (frame) => {
      const answer = await addFrames(set, room, drive, [frame]);
      const reason = answer.refused[0]?.reason;
      if (reason !== undefined) refuse(reason);
    },
  });
  const queue = sender.current;

  /** Looks once; takes what shows another view. */
  const look = async () => {
    const video = latest.current.video.current;
    if (isFinished.current) return;
    if (!video || video.readyState < HTMLMediaElement.HAVE_CURRENT_DATA) return;
    if (!queue.hasRoom) {
      setSaid("waiting");
      return;
    }
    small.current ??= document.createElement("canvas");
    const next = considered(recording.current, viewOf(pixelsOf(video, small.current)));
    if (next.last === "taken") {
      const picture = await latest.current.grab(WIDTH);
      const name = `${String(next.taken.length).padStart(4, "0")}.jpg`;
      if (!picture || !queue.offer({ name, picture })) return;
      setCount(next.taken.length);
    }
    recording.current = next;
    setSaid(next.last);
  };

  useEffect(() => {
    if (!isTaking || !camera.running) return undefined;
    let timer: ReturnType<typeof setTimeout> | undefined;
    let isOver = false;
    const turn = async () => {
      looking.current = look();
      await looking.current;
      if (!isOver) timer = setTimeout(() => void turn(), LOOK_MS);
    };
    void turn();
    return () => {
      isOver = true;
      clearTimeout(timer);
    };
  }, [isTaking, camera.running]);

  useEffect(() => {
    if (sending.waiting === 0) return undefined;
    const warn = (event: BeforeUnloadEvent) => event.preventDefault();
    addEventListener("beforeunload", warn);
    return () => removeEventListener("beforeunload", warn);
  }, [sending.waiting === 0]);

  const finish = async () => {
    isFinished.current = true;
    setTaking(false);
    // The frame that is looked at may be taken yet.
    await looking.current;
    await queue.empty();
    return recording.current.taken.length - dropped.current;
  };

  useAwake(isTaking);
  return {
    taken,
    said,
    sending,
    refused,
    drive,
    isTaking,
    setTaking,
    resume: () => queue.resume(),
    finish,
  };
}

function pixelsOf(video: HTMLVideoElement, canvas: HTMLCanvasElement): Pixels {
  canvas.width = SMALL_WIDTH;
  canvas.height = Math.max(1, Math.round((SMALL_WIDTH * video.videoHeight) / video.videoWidth));
  const context = canvas.getContext("2d", { willReadFrequently: true });
  if (!context) return { data: [], width: 0, height: 0 };
  context.drawImage(video, 0, 0, canvas.width, canvas.height);
  return context.getImageData(0, 0, canvas.width, canvas.height);
}

/** Keeps the screen of a phone on. */
function useAwake(isWanted: boolean) {
  useEffect(() => {
    const wakeLock = (navigator as Partial<Navigator>).wakeLock;
    if (!isWanted || !wakeLock) return undefined;
    // Where it is refused, as with a low battery, the screen goes off as ever.
    const lock = wakeLock.request("screen").catch(() => undefined);
    return () => void lock.then((held) => held?.release());
  }, [isWanted]);
}
