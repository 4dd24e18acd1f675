import { describe, expect, it } from "vitest";
import { difference, lumaOf, sharpness, viewOf, type Pixels } from "./view";

function picture(gray: (x: number, y: number) => number, width = 64, height = 48): Pixels {
  const data = new Uint8ClampedArray(4 * width * height);
  for (let y = 0; y < height; y++) {
    for (let x = 0; x < width; x++) {
      data.fill(gray(x, y), 4 * (y * width + x), 4 * (y * width + x) + 3);
    }
  }
  return { data, width, height };
}

const stripes = (shift: number, period = 16) =>
  picture((x) => ((x + shift) % period < period / 2 ? 40 : 200));
/** The same, as if the camera had moved while the shutter was open. */
const smeared = picture((x) => 120 + 80 * Math.sin((2 * Math.PI * x) / 16));

describe("sharpness", () => {
  it("is larger of edges than of slopes, and none of a wall", () => {
    const [sharp, blurred, wall] = [stripes(0), smeared, picture(() => 128)].map((pixels) =>
      sharpness(lumaOf(pixels)),
    );
    expect(sharp).toBeGreaterThan(4 * blurred!);
    expect(wall).toBe(0);
  });

  it("of a picture without an inside is 0", () => {
    expect(sharpness(lumaOf(picture(() => 0, 2, 2)))).toBe(0);
  });
});

describe("the difference of views", () => {
  it("is none of the same, and more the further the camera turned", () => {
    const [start, little, far] = [stripes(0, 32), stripes(2, 32), stripes(16, 32)].map(viewOf);
    expect(difference(start!, start!)).toBe(0);
    expect(difference(start!, little!)).toBeLessThan(difference(start!, far!));
    expect(difference(start!, far!)).toBeGreaterThan(1);
  });

  it("does not come from light", () => {
    const day = viewOf(picture((x) => (x % 32 < 16 ? 80 : 240)));
    const evening = viewOf(picture((x) => (x % 32 < 16 ? 40 : 120)));
    expect(difference(day, evening)).toBeLessThan(0.02);
  });

  it("does not come from noise on a wall", () => {
    const noise = (seed: number) => picture((x, y) => 128 + ((x * 7 + y * 13 + seed * 31) % 5));
    expect(difference(viewOf(noise(1)), viewOf(noise(2)))).toBeLessThan(0.1);
  });
});

describe("brightness", () => {
  it("is the mean gray value", () => {
    expect(viewOf(picture(() => 17)).brightness).toBeCloseTo(17, 1);
  });
});
