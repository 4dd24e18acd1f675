import { ApiError } from "../../api/client";
import {
  activate,
  deleteVersion,
  makeDefault,
  putLabel,
  removeLabel,
  rollBack,
} from "../../api/versions";
import type { ModelInfo } from "../../api/models";
import { confirm } from "../../components/dialog";
import { toast, toastError } from "../../components/toast";
import { percent } from "../../format";
import { useAction } from "../../hooks";
import { text } from "../../texts/models";

/** What can be done to a model: each of it is of the epoch that was seen. */
export interface Changer {
  busy: boolean;
  shadow: (version: number) => void;
  canary: (version: number, share: number) => void;
  stable: (version: number) => void;
  stop: (version: number, label: "shadow" | "canary") => void;
  rollBack: () => void;
  makeDefault: () => void;
  remove: (version: number) => void;
}

/** Changes a model; where somebody else was faster, it is loaded again and that is told. */
export function useChanger(model: ModelInfo, reload: () => void): Changer {
  const { name, epoch } = model;
  const id = (version: number) => `${name}/${version}`;
  const { run, busy } = useAction(async (change: () => Promise<unknown>, told: string) => {
    try {
      await change();
      toast({ text: told });
    } catch (error) {
      if (error instanceof ApiError && error.status === 412) {
        toast({ text: text.stale, kind: "bad" });
      } else {
        toastError(error);
      }
    }
    reload();
  });
  const does = (change: () => Promise<unknown>, told: string) => void run(change, told);
  return {
    busy,
    shadow: (version) =>
      does(() => putLabel(name, "shadow", version, epoch), text.isShadow(id(version))),
    canary: (version, share) =>
      does(
        () => putLabel(name, "canary", version, epoch, share),
        text.isCanary(id(version), percent(share)),
      ),
    stable: (version) => does(() => activate(name, version, epoch), text.isStable(id(version))),
    stop: (version, label) => does(() => removeLabel(name, label, epoch), text.isOff(id(version))),
    rollBack: () => does(() => rollBack(name, epoch), text.rolledBack(name)),
    makeDefault: () => does(() => makeDefault(name), text.madeDefault(name)),
    remove: (version) => {
      const question = {
        title: text.removeTitle(id(version)),
        text: text.removeText,
        action: text.remove,
        danger: true,
      };
      void confirm(question).then((yes) => {
        if (yes) does(() => deleteVersion(name, version, epoch), text.removed(id(version)));
      });
    },
  };
}
