import type { Transition } from "../../api/models";

export interface Point {
  x: number;
  y: number;
}

/** A way between two rooms, whichever way it is gone. */
export interface Way {
  one: string;
  other: string;
  /** The larger of the two rates. */
  rate: number;
}

/** Ways that are gone more seldom than this, either way, are left out: most are what a model allows for, unseen. */
const LEAST_RATE = 0.12;
const ROUNDS = 300;

/** The ways between rooms, each once. */
export function waysOf(transitions: readonly Transition[]): Way[] {
  const ways = new Map<string, Way>();
  for (const { from, to, rate } of transitions) {
    if (from === to || rate < LEAST_RATE) continue;
    const [one, other] = from < to ? [from, to] : [to, from];
    const key = JSON.stringify([one, other]);
    ways.set(key, { one, other, rate: Math.max(rate, ways.get(key)?.rate ?? 0) });
  }
  return [...ways.values()];
}

/**
 * Places rooms so that those with a way between them lie near each other: springs along the ways, and all rooms keep
 * apart. It begins on a circle and throws no dice, so that the same rooms always lie the same. Within 0 to 1.
 */
export function placed(rooms: readonly string[], ways: readonly Way[]): Map<string, Point> {
  const turn = (2 * Math.PI) / Math.max(1, rooms.length);
  const points = new Map<string, Point>(
    rooms.map((room, at) => [room, { x: Math.cos(at * turn), y: Math.sin(at * turn) }]),
  );
  const ideal = 1.6 / Math.sqrt(Math.max(1, rooms.length));
  for (let round = 0; round < ROUNDS; round += 1) {
    const longest = 0.12 * (1 - round / ROUNDS);
    const forces = new Map(rooms.map((room) => [room, { x: 0, y: 0 }]));
    const push = (one: string, other: string, strength: (distance: number) => number) => {
      const [a, b] = [points.get(one), points.get(other)];
      const [f, g] = [forces.get(one), forces.get(other)];
      if (!a || !b || !f || !g) return;
      const [x, y] = [b.x - a.x, b.y - a.y];
      const distance = Math.max(0.01, Math.hypot(x, y));
      const share = strength(distance) / distance;
      f.x -= x * share;
      f.y -= y * share;
      g.x += x * share;
      g.y += y * share;
    };
    rooms.forEach((one, at) => {
      for (const other of rooms.slice(at + 1)) push(one, other, (d) => (ideal * ideal) / d);
    });
    for (const { one, other } of ways) push(one, other, (d) => -(d * d) / ideal);
    for (const [room, force] of forces) {
      const point = points.get(room);
      const size = Math.hypot(force.x, force.y);
      if (!point || size === 0) continue;
      const step = Math.min(size, longest) / size;
      point.x += force.x * step;
      point.y += force.y * step;
    }
  }
  return fitted(points);
}

/** Stretches points to the square from 0 to 1; what has no extent lies in its middle. */
function fitted(points: Map<string, Point>): Map<string, Point> {
  const all = [...points.values()];
  const axis = (of: (point: Point) => number) => {
    const values = all.map(of);
    const [least, most] = [Math.min(...values), Math.max(...values)];
    return (value: number) => (most - least < 1e-9 ? 0.5 : (value - least) / (most - least));
  };
  const [x, y] = [axis((point) => point.x), axis((point) => point.y)];
  return new Map([...points].map(([room, point]) => [room, { x: x(point.x), y: y(point.y) }]));
}

/** Where the robots of a room stand: on rings around its middle, the first ones below it, side by side. */
export function around(n: number, radius: number, size: number): Point[] {
  const points: Point[] = [];
  for (let ring = 0; points.length < n; ring += 1) {
    const r = radius + ring * size;
    const seats = Math.max(1, Math.floor((2 * Math.PI * r) / size));
    const taken = Math.min(seats, n - points.length);
    for (let seat = 0; seat < taken; seat += 1) {
      const angle = Math.PI / 2 + ((seat - (taken - 1) / 2) / seats) * 2 * Math.PI;
      points.push({ x: Math.cos(angle) * r, y: Math.sin(angle) * r });
    }
  }
  return points;
}
