/** Sends parcels one after another: what could not be sent waits and is tried again, nothing is lost on the way. */

/** What to do after an error. */
export interface Judgment {
  /** `again`: by itself in a while. `stop`: when somebody says so. `drop`: this parcel can never be sent. */
  readonly then: "again" | "stop" | "drop";
  readonly reason: string;
}

export interface SenderState {
  /** Parcels that wait, with the one on its way. */
  readonly waiting: number;
  readonly sent: number;
  /** Why nothing is sent at the moment. */
  readonly held?: Judgment;
}

export interface SenderOptions<Parcel> {
  /** More parcels than these are not taken. */
  readonly capacity: number;
  readonly send: (parcel: Parcel) => Promise<void>;
  readonly judge: (error: unknown) => Judgment;
  /** Hears of parcels that can never be sent. */
  readonly dropped: (parcel: Parcel, reason: string) => void;
  readonly changed: (state: SenderState) => void;
  /** Waits so many milliseconds. */
  readonly sleep?: (milliseconds: number) => Promise<void>;
}

const FIRST_PAUSE_MS = 500;
const LONGEST_PAUSE_MS = 8000;

const slept = (milliseconds: number) => new Promise<void>((done) => setTimeout(done, milliseconds));

export class Sender<Parcel> {
  private readonly parcels: Parcel[] = [];
  private readonly options: SenderOptions<Parcel>;
  private sent = 0;
  private held: Judgment | undefined;
  private isRunning = false;
  private isClosed = false;
  private idle: (() => void)[] = [];

  constructor(options: SenderOptions<Parcel>) {
    this.options = options;
  }

  get state(): SenderState {
    const state = { waiting: this.parcels.length, sent: this.sent };
    return this.held === undefined ? state : { ...state, held: this.held };
  }

  /** Whether another parcel would be taken. */
  get hasRoom(): boolean {
    return (
      !this.isClosed && this.parcels.length < this.options.capacity && this.held?.then !== "stop"
    );
  }

  /** Takes a parcel, unless too many wait. */
  offer(parcel: Parcel): boolean {
    if (!this.hasRoom) {
      return false;
    }
    this.parcels.push(parcel);
    this.changed();
    void this.run();
    return true;
  }

  /** Goes on after a stop. */
  resume(): void {
    if (this.held?.then === "stop") {
      this.held = undefined;
      this.changed();
      void this.run();
    }
  }

  /** Resolves once nothing waits any more. */
  async empty(): Promise<void> {
    if (this.parcels.length > 0) {
      await new Promise<void>((done) => this.idle.push(done));
    }
  }

  /** Gives up what waits. */
  close(): void {
    this.isClosed = true;
    this.parcels.length = 0;
    this.settled();
  }

  private async run(): Promise<void> {
    if (this.isRunning) {
      return;
    }
    this.isRunning = true;
    let pause = FIRST_PAUSE_MS;
    for (let parcel = this.parcels[0]; parcel !== undefined; parcel = this.parcels[0]) {
      const judgment = await this.attempt(parcel);
      if (judgment?.then === "stop") {
        break;
      }
      if (judgment?.then === "again") {
        await (this.options.sleep ?? slept)(pause);
        pause = Math.min(2 * pause, LONGEST_PAUSE_MS);
      } else {
        pause = FIRST_PAUSE_MS;
      }
    }
    this.isRunning = false;
    this.settled();
  }

  private async attempt(parcel: Parcel): Promise<Judgment | undefined> {
    let judgment: Judgment | undefined;
    try {
      await this.options.send(parcel);
    } catch (error) {
      judgment = this.options.judge(error);
    }
    if (this.isClosed) {
      return judgment;
    }
    if (judgment === undefined || judgment.then === "drop") {
      this.parcels.shift();
      this.held = undefined;
    } else {
      this.held = judgment;
    }
    if (judgment === undefined) {
      this.sent += 1;
    } else if (judgment.then === "drop") {
      this.options.dropped(parcel, judgment.reason);
    }
    this.changed();
    return judgment;
  }

  private settled(): void {
    if (this.parcels.length === 0) {
      this.idle.forEach((done) => done());
      this.idle = [];
    }
  }

  private changed(): void {
    this.options.changed(this.state);
  }
}
