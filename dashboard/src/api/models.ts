import { call, part } from "./client";

export type VersionState =
  | "discovered"
  | "verifying"
  | "loading"
  | "warming"
  | "ready"
  | "quiescing"
  | "unloaded"
  | "failed";

export interface StateChange {
  state: VersionState;
  at: string;
}

/** How a shadow compares with the stable version. */
export interface ShadowInfo {
  compared: number;
  agreed: number;
  skipped: number;
  mean_distance?: number | null;
}

export interface VersionInfo {
  version: number;
  state: VersionState;
  labels: string[];
  history: StateChange[];
  digest?: string | null;
  epoch?: number | null;
  rooms?: string[] | null;
  share?: number | null;
  failure?: { stage: string; reason: string } | null;
  shadow?: ShadowInfo | null;
  card?: unknown;
}

export interface ModelInfo {
  name: string;
  epoch: number;
  serving?: number | null;
  default?: boolean;
  settled?: number;
  versions: VersionInfo[];
}

export interface ModelList {
  models: ModelInfo[];
  default?: string | null;
}

export const listModels = (signal?: AbortSignal) => call<ModelList>("v1/models", { signal });

export interface Transition {
  from: string;
  to: string;
  rate: number;
}

export interface MapPosition {
  room: string;
  x: number;
  y: number;
}

/** How the rooms of a version lie to each other. */
export interface ModelMap {
  rooms: string[];
  transitions: Transition[];
  positions: MapPosition[];
}

export const getMap = (model: string, version: number, signal?: AbortSignal) =>
  call<ModelMap>(`v1/models/${part(model)}/versions/${version}/map`, { signal });
