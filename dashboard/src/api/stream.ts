import { address } from "./client";
import type { Answer, RoomProbability } from "./recognize";

/** What the frames of a stream so far say together. */
export interface Filtered {
  room: string;
  probability: number;
  probabilities: RoomProbability[];
  known?: boolean;
  novelty?: number | null;
}

/** What a frame of a stream says. */
export interface StreamResult extends Answer {
  seq: number;
  age_ms?: number | null;
  filtered?: Filtered | null;
}

type ServerMessage =
  | ({ type: "result" } & StreamResult)
  | { type: "dropped"; seq: number; reason: string }
  | { type: "error"; seq: number; problem: { detail: string } }
  | { type: "hello" | "model_changed" | "configured" | "draining" };

export interface StreamListener {
  onHello: () => void;
  onResult: (result: StreamResult) => void;
  /** A frame that was not answered: why. */
  onRefused: (reason: string) => void;
  /** Any end of a frame: the next one may be sent. */
  onReady: () => void;
  onClose: (code: number, reason: string) => void;
}

/** Close codes that say that the key is not good enough, or no longer. */
export const POLICY = 1008;

/** A stream of frames to the service. */
export class FrameStream {
  readonly #socket: WebSocket;

  constructor(robot: string, explain: boolean, listener: StreamListener) {
    const url = new URL(address("v1/stream", { robot, explain, mode: "latest" }));
    url.protocol = url.protocol === "https:" ? "wss:" : "ws:";
    this.#socket = new WebSocket(url, "roomsight.v1");
    this.#socket.addEventListener("message", (event: MessageEvent<string>) =>
      hear(JSON.parse(event.data) as ServerMessage, listener),
    );
    this.#socket.addEventListener("close", ({ code, reason }) => listener.onClose(code, reason));
  }

  send(frame: Blob): void {
    if (this.#socket.readyState === WebSocket.OPEN) this.#socket.send(frame);
  }

  /** Whether answers name what spoke for them. */
  explain(explain: boolean): void {
    if (this.#socket.readyState === WebSocket.OPEN) {
      this.#socket.send(JSON.stringify({ type: "configure", explain }));
    }
  }

  close(): void {
    this.#socket.close(1000);
  }
}

function hear(message: ServerMessage, listener: StreamListener): void {
  switch (message.type) {
    case "hello":
      listener.onHello();
      listener.onReady();
      break;
    case "result":
      listener.onResult(message);
      listener.onReady();
      break;
    case "dropped":
      listener.onReady();
      break;
    case "error":
      listener.onRefused(message.problem.detail);
      listener.onReady();
      break;
    default:
      // Messages that are not known here may come later.
      break;
  }
}
