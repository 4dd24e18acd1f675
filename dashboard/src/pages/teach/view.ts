/** What a camera frame looks like: how bright, how sharp, and how much like another it is. */

/** Pixels as a canvas gives them: red, green, blue, alpha. */
export interface Pixels {
  readonly data: ArrayLike<number>;
  readonly width: number;
  readonly height: number;
}

/** Gray values, row by row, 0 to 255. */
export interface Luma {
  readonly values: Float32Array;
  readonly width: number;
  readonly height: number;
}

/** What is kept of a frame to compare others with. */
export interface View {
  /** Mean gray value. */
  readonly brightness: number;
  /** Variance of the Laplacian. */
  readonly sharpness: number;
  /** A small picture of mean 0 and length 1. */
  readonly thumbnail: Float32Array;
}

const THUMBNAIL_WIDTH = 16;
const THUMBNAIL_HEIGHT = 12;

/** Noise of a camera in gray values: without it two pictures of a bare wall would differ by nothing else. */
const NOISE = 4;

export function lumaOf({ data, width, height }: Pixels): Luma {
  const values = new Float32Array(width * height);
  for (let pixel = 0; pixel < values.length; pixel++) {
    const at = 4 * pixel;
    values[pixel] =
      0.299 * (data[at] ?? 0) + 0.587 * (data[at + 1] ?? 0) + 0.114 * (data[at + 2] ?? 0);
  }
  return { values, width, height };
}

export function mean(values: ArrayLike<number>): number {
  let sum = 0;
  for (let index = 0; index < values.length; index++) {
    sum += values[index] ?? 0;
  }
  return values.length === 0 ? 0 : sum / values.length;
}

/** The variance of the Laplacian: the sharper a picture, the larger. */
export function sharpness({ values, width, height }: Luma): number {
  const at = (x: number, y: number) => values[y * width + x] ?? 0;
  let sum = 0;
  let squares = 0;
  let count = 0;
  for (let y = 1; y < height - 1; y++) {
    for (let x = 1; x < width - 1; x++) {
      const laplacian = 4 * at(x, y) - at(x - 1, y) - at(x + 1, y) - at(x, y - 1) - at(x, y + 1);
      sum += laplacian;
      squares += laplacian * laplacian;
      count += 1;
    }
  }
  return count === 0 ? 0 : squares / count - (sum / count) ** 2;
}

/** Means of cells, of mean 0 and length 1, so that brighter and darker light make no difference. */
export function thumbnail({ values, width, height }: Luma): Float32Array {
  const sums = new Float32Array(THUMBNAIL_WIDTH * THUMBNAIL_HEIGHT);
  const counts = new Float32Array(sums.length);
  for (let y = 0; y < height; y++) {
    const row = Math.floor((y * THUMBNAIL_HEIGHT) / height);
    for (let x = 0; x < width; x++) {
      const cell = row * THUMBNAIL_WIDTH + Math.floor((x * THUMBNAIL_WIDTH) / width);
      sums[cell] = (sums[cell] ?? 0) + (values[y * width + x] ?? 0);
      counts[cell] = (counts[cell] ?? 0) + 1;
    }
  }
  const means = sums.map((sum, cell) => sum / Math.max(counts[cell] ?? 0, 1));
  const middle = mean(means);
  const squares = means.reduce((total, value) => total + (value - middle) ** 2, 0);
  const length = Math.sqrt(squares + means.length * NOISE ** 2);
  return means.map((value) => (value - middle) / length);
}

export function viewOf(pixels: Pixels): View {
  const luma = lumaOf(pixels);
  return { brightness: mean(luma.values), sharpness: sharpness(luma), thumbnail: thumbnail(luma) };
}

/** How much two views differ: 0 is the same, 1 has nothing in common. */
export function difference(a: View, b: View): number {
  let squares = 0;
  for (let cell = 0; cell < a.thumbnail.length; cell++) {
    squares += ((a.thumbnail[cell] ?? 0) - (b.thumbnail[cell] ?? 0)) ** 2;
  }
  return squares / 2;
}
