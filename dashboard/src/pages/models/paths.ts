/** Addresses within the page. No model's name has a tilde. */

import { href } from "../../route";

export const TRAININGS = "~trainings";
export const AUDIT = "~audit";
export const COMPARE = "~compare";

export const trainingHref = (id: number) => href("models", TRAININGS, id);

/** What stands in a comparison: a version of a model, or a training. */
export type Subject =
  { kind: "version"; model: string; version: number } | { kind: "training"; id: number };

/** As it stands in an address: `home@3` or `~12`. */
export function written(subject: Subject): string {
  return subject.kind === "training" ? `~${subject.id}` : `${subject.model}@${subject.version}`;
}

export function parsed(text: string | undefined): Subject | undefined {
  const training = /^~(\d+)$/.exec(text ?? "");
  if (training) return { kind: "training", id: Number(training[1]) };
  const version = /^([^@~]+)@(\d+)$/.exec(text ?? "");
  if (!version) return undefined;
  return { kind: "version", model: version[1] ?? "", version: Number(version[2]) };
}

export const compareHref = (left: Subject, right: Subject) =>
  href("models", COMPARE, written(left), written(right));
