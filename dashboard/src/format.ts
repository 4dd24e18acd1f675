const NOTHING = "–";
/** Between a number and its unit, which stay on one line. */
const SPACE = "\u00a0";

/** Made once: making one takes far longer than using it. */
const formats = new Map<number, Intl.NumberFormat>();

function formatted(value: number, digits: number): string {
  let format = formats.get(digits);
  if (!format) {
    format = new Intl.NumberFormat("en", {
      minimumFractionDigits: digits,
      maximumFractionDigits: digits,
    });
    formats.set(digits, format);
  }
  return format.format(value);
}

/** A share as percent: 0.824 is "82 %", and what is not quite all is never "100 %". */
export function percent(share: number | null | undefined): string {
  if (share === null || share === undefined || !Number.isFinite(share)) return NOTHING;
  const value = share * 100;
  if (value > 0 && value < 1) return `<${SPACE}1${SPACE}%`;
  if (value > 99 && value < 100) return `>${SPACE}99${SPACE}%`;
  return `${Math.round(value)}${SPACE}%`;
}

/** A number with as many digits as help. */
export function count(value: number | null | undefined): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return NOTHING;
  return formatted(Math.round(value), 0);
}

export function decimal(value: number | null | undefined, digits = 1): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return NOTHING;
  return formatted(value, digits);
}

/** Milliseconds, as seconds where there are many. */
export function milliseconds(value: number | null | undefined): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return NOTHING;
  if (value >= 10_000) return `${decimal(value / 1000)}${SPACE}s`;
  return `${value < 10 ? decimal(value) : count(value)}${SPACE}ms`;
}

/** Seconds, in the two largest units: "3 min 20 s". */
export function duration(seconds: number | null | undefined): string {
  if (seconds === null || seconds === undefined || !Number.isFinite(seconds)) return NOTHING;
  const whole = Math.max(0, Math.floor(seconds));
  const units: [string, number][] = [
    ["d", 86_400],
    ["h", 3600],
    ["min", 60],
    ["s", 1],
  ];
  const first = units.findIndex(([, size]) => whole >= size);
  if (first < 0) return `0${SPACE}s`;
  let left = whole;
  const said: string[] = [];
  for (const [name, size] of units.slice(first, first + 2)) {
    const n = Math.floor(left / size);
    left -= n * size;
    if (n > 0) said.push(`${n}${SPACE}${name}`);
  }
  return said.join(" ");
}

/** Bytes in units of 1024. */
export function bytes(value: number | null | undefined): string {
  if (value === null || value === undefined || !Number.isFinite(value)) return NOTHING;
  const units = ["B", "KiB", "MiB", "GiB", "TiB"];
  let unit = 0;
  let left = value;
  while (left >= 1024 && unit < units.length - 1) {
    left /= 1024;
    unit += 1;
  }
  return `${unit === 0 || left >= 100 ? count(left) : decimal(left)}${SPACE}${units[unit]}`;
}

/** A time of the service, in the reader's own zone. */
export function dateTime(at: string | null | undefined): string {
  const date = new Date(at ?? NaN);
  if (Number.isNaN(date.getTime())) return NOTHING;
  return date.toLocaleString("en-GB", { dateStyle: "medium", timeStyle: "short" });
}

/** The same, without the day. */
export function timeOfDay(at: string | null | undefined): string {
  const date = new Date(at ?? NaN);
  if (Number.isNaN(date.getTime())) return NOTHING;
  return date.toLocaleTimeString("en-GB");
}

/** A number of things: "1 frame", "12 frames". */
export function plural(n: number, one: string, many = `${one}s`): string {
  return `${count(n)} ${n === 1 ? one : many}`;
}
