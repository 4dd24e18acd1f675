import { type ChildProcess, spawn } from "node:child_process";
import { once } from "node:events";
import { PROGRAM, SIMULATED } from "./paths";
import type { Service } from "./service";

export interface DriveOptions {
  robots?: number;
  /** Frames a second. */
  rate?: number;
  /** How many frames each robot sends; without it they drive until they are stopped. */
  limit?: number;
}

/** Robots that drive through the lab, each over a stream of its own: `replay-0`, `replay-1`. */
export class Robots {
  private constructor(private readonly process: ChildProcess) {}

  static drive(service: Service, options: DriveOptions = {}): Robots {
    const { robots = 1, rate = 4, limit } = options;
    const how = ["--camera=perspective", "--quiet", `--robots=${robots}`, `--rate=${rate}`];
    const end = limit === undefined ? "--loop" : `--limit=${limit}`;
    const key = service.key === undefined ? [] : ["--key", service.key];
    return new Robots(
      spawn(PROGRAM, ["replay", SIMULATED, "--url", service.url, ...how, end, ...key], {
        stdio: "ignore",
      }),
    );
  }

  /** Waits until they have sent what they were to send. */
  async finished(): Promise<void> {
    if (this.process.exitCode === null) await once(this.process, "exit");
  }

  async stop(): Promise<void> {
    this.process.kill("SIGTERM");
    if (this.process.exitCode === null && this.process.signalCode === null) await this.finished();
  }
}
