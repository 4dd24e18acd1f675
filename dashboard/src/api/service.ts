import { call } from "./client";

export interface ServiceInfo {
  version: string;
  started_at: string;
  uptime_s: number;
  /** Whether it has a data directory: data sets, inbox, trainings, audit. */
  data: boolean;
  /** Whether it asks for keys. */
  keys: boolean;
  threads: number;
  /** Whether last frames are kept for Live. */
  frames_kept: boolean;
  lost_after_s: number;
  models_folder?: string;
  webhooks: number;
  mqtt: boolean;
}

export interface LatencyMs {
  queue: number;
  decode: number;
  features: number;
  classify: number;
}

/** What happened in one interval. */
export interface HistoryPoint {
  at: string;
  answers: number;
  errors: number;
  refused: number;
  dropped: number;
  unknown: number;
  queue: number;
  busy: number;
  memory_bytes: number;
  cpu_s: number;
  latency_ms: LatencyMs;
  p50_ms: number;
  p99_ms: number;
  streams: number;
  robots: number;
  lost: number;
}

export interface History {
  interval_s: number;
  points: HistoryPoint[];
}

export const getService = (signal?: AbortSignal) => call<ServiceInfo>("v1/service", { signal });

export const getHistory = (signal?: AbortSignal) => call<History>("v1/service/history", { signal });
