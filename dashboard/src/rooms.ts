const N_COLORS = 12;
const taken = new Map<string, number>();

/** The class that gives a room its color: by its name, and the next free one where two names meet. */
export function roomClass(room: string | null | undefined): string {
  if (!room) return "";
  let color = taken.get(room);
  if (color === undefined) {
    let hash = 0;
    for (const char of room) hash = (hash * 31 + (char.codePointAt(0) ?? 0)) >>> 0;
    color = hash % N_COLORS;
    const used = new Set(taken.values());
    for (let tries = 0; tries < N_COLORS && used.has(color); tries += 1) {
      color = (color + 1) % N_COLORS;
    }
    taken.set(room, color);
  }
  return `room-${color}`;
}
