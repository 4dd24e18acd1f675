import { getMap, type ModelMap } from "./api/models";

const maps = new Map<string, Promise<ModelMap>>();

/** How the rooms of a version lie to each other; asked for once, since a version never changes. */
export function mapOf(model: { name: string; version: number }): Promise<ModelMap> {
  const key = `${model.name}/${model.version}`;
  const asked = maps.get(key);
  if (asked) return asked;
  const map = getMap(model.name, model.version);
  maps.set(key, map);
  map.catch(() => maps.delete(key));
  return map;
}
