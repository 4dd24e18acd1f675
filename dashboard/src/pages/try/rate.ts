/** How many things a second happened lately, and how long each took in the mean. */
export class Rate {
  readonly #window: number;
  #seen: { at: number; took: number }[] = [];

  constructor(windowMs = 3000) {
    this.#window = windowMs;
  }

  add(at: number, took: number): void {
    this.#seen.push({ at, took });
    this.#seen = this.#seen.filter((one) => at - one.at <= this.#window);
  }

  perSecond(): number {
    const [first, last] = [this.#seen[0], this.#seen.at(-1)];
    if (!first || !last || last.at === first.at) return 0;
    return ((this.#seen.length - 1) * 1000) / (last.at - first.at);
  }

  meanMs(): number {
    const { length } = this.#seen;
    return length === 0 ? 0 : this.#seen.reduce((sum, { took }) => sum + took, 0) / length;
  }
}
