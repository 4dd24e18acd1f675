import { address, call, fetchFrom, part } from "./client";
import type { FramePose, RoomProbability, TimingsMs, Unknown } from "./recognize";

export interface FrameCounts {
  accepted: number;
  results: number;
  errors: number;
  dropped: Record<string, number>;
}

/** A robot, or whoever else sends frames, as it is now. */
export interface Robot {
  /** The robot's name, or the stream's where it has none. */
  id: string;
  robot?: string | null;
  stream?: string | null;
  /** Where it is connected, of a robot of another service. */
  service?: string | null;
  via: "stream" | "rest";
  key?: string | null;
  connected: boolean;
  last_seen_s: number;
  room?: string | null;
  known: boolean;
  unknown?: Unknown | null;
  novelty?: number | null;
  probability?: number | null;
  probabilities: RoomProbability[];
  in_room_s?: number | null;
  lost: boolean;
  lost_s?: number | null;
  frames_per_s: number;
  age_ms?: number | null;
  latency_ms?: number | null;
  frames: FrameCounts;
  /** The number of its kept last frame. */
  frame?: number | null;
  model?: { name: string; version: number } | null;
  /** Where it is, more or less, where the model can tell. */
  pose?: FramePose | null;
}

export interface LiveMessage {
  at: string;
  robots: Robot[];
  gone: string[];
  /** Changes that this reader was too slow for. */
  lost_events: number;
}

export interface PastAnswer {
  seq: number;
  room: string;
  known?: boolean;
  probability: number;
  ago_s: number;
  timings_ms: TimingsMs;
}

export interface RibbonPart {
  room: string;
  known: boolean;
  from: string;
  until: string;
}

export interface RobotInfo extends Robot {
  mode?: string;
  streaming_s?: number;
  /** The newest first. */
  answers: PastAnswer[];
  /** Its rooms of the last minutes, the oldest first. */
  ribbon?: RibbonPart[];
}

export const listRobots = async (signal?: AbortSignal) =>
  (await call<{ robots: RobotInfo[] }>("v1/robots?scope=fleet", { signal })).robots;

export const getRobot = (id: string, signal?: AbortSignal) =>
  call<RobotInfo>(`v1/robots/${part(id)}`, { signal });

/** Its last frame as the robot sent it. */
export async function fetchFrame(id: string): Promise<Blob> {
  const response = await fetchFrom(frameAddress(id), { headers: { Accept: "image/*" } });
  return await response.blob();
}

/** The address of its last frame; without a width the picture as the robot sent it. */
export const frameAddress = (id: string, width?: number) =>
  address(`v1/robots/${part(id)}/frame`, { width });
