import { call } from "./client";

export interface RoomProbability {
  room: string;
  probability: number;
}

export type Unknown = "unsure" | "new_place" | "no_detail" | "dark" | "covered";

export interface ModelName {
  name: string;
  version: number;
  epoch: number;
  digest: string;
}

export interface TimingsMs {
  queue: number;
  decode: number;
  features: number;
  classify: number;
}

/** One keypoint's share in an answer, in pixels of the frame as sent. */
export interface KeypointEvidence {
  x: number;
  y: number;
  weight: number;
  opinion: string;
  word?: number | null;
  frame?: string | null;
}

/** A training frame that is like the frame. */
export interface NearestFrame {
  opinion: string;
  frame: string;
  drive: string;
  room: string;
  nearness: number;
  points?: [number, number][];
}

export interface FramePose {
  x: number;
  y: number;
  angle: number;
  radius: number;
}

export interface Answer {
  room: string;
  probability: number;
  probabilities: RoomProbability[];
  known: boolean;
  unknown?: Unknown | null;
  novelty?: number | null;
  model: ModelName;
  keypoints: number;
  timings_ms: TimingsMs;
  damaged_rows?: number;
  evidence?: KeypointEvidence[] | null;
  nearest?: NearestFrame[] | null;
  pose?: FramePose | null;
  request_id: string;
  robot?: string | null;
}

export interface RecognizeOptions {
  model?: string;
  version?: number;
  explain?: boolean;
  robot?: string;
  signal?: AbortSignal;
}

export const recognize = (frame: Blob, options: RecognizeOptions = {}) =>
  call<Answer>("v1/recognize", {
    method: "POST",
    body: frame,
    headers: { "Content-Type": frame.type || "application/octet-stream" },
    query: {
      model: options.model,
      version: options.version,
      robot: options.robot,
      explain: options.explain || undefined,
    },
    signal: options.signal,
  });
