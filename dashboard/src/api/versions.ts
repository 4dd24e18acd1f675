/** What serves of a model, and how it is changed: each change is of the epoch that was seen. */

import { call, part } from "./client";
import type { ModelInfo, VersionInfo } from "./models";
import type { Card } from "./trainings";

/** A version with its card. */
export interface VersionDetails extends VersionInfo {
  card?: Card | null;
}

/** A label beside `stable`, which `activate` gives. */
export type Label = "canary" | "shadow";

const modelPath = (model: string) => `v1/models/${part(model)}`;
const ifMatch = (epoch: number) => ({ "If-Match": `"${epoch}"` });

export const getModel = (model: string, signal?: AbortSignal) =>
  call<ModelInfo>(modelPath(model), { signal });

export const getVersion = (model: string, version: number, signal?: AbortSignal) =>
  call<VersionDetails>(`${modelPath(model)}/versions/${version}`, { signal });

export const activate = (model: string, version: number, epoch: number) =>
  call<VersionInfo>(`${modelPath(model)}/versions/${version}/activate`, {
    method: "POST",
    headers: ifMatch(epoch),
  });

export const putLabel = (
  model: string,
  label: Label,
  version: number,
  epoch: number,
  share?: number,
) =>
  call<ModelInfo>(`${modelPath(model)}/labels/${label}`, {
    method: "PUT",
    json: { version, share },
    headers: ifMatch(epoch),
  });

export const removeLabel = (model: string, label: Label, epoch: number) =>
  call<ModelInfo>(`${modelPath(model)}/labels/${label}`, {
    method: "DELETE",
    headers: ifMatch(epoch),
  });

export const rollBack = (model: string, epoch: number) =>
  call<ModelInfo>(`${modelPath(model)}/rollback`, { method: "POST", headers: ifMatch(epoch) });

export const makeDefault = (model: string) =>
  call<ModelInfo>(`${modelPath(model)}/default`, { method: "PUT" });

export const deleteVersion = (model: string, version: number, epoch: number) =>
  call<void>(`${modelPath(model)}/versions/${version}`, {
    method: "DELETE",
    headers: ifMatch(epoch),
  });
