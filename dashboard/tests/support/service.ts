import { type ChildProcess, spawn } from "node:child_process";
import { once } from "node:events";
import { cp, mkdtemp, readFile, rm } from "node:fs/promises";
import { tmpdir } from "node:os";
import { basename, dirname, join } from "node:path";
import { createInterface } from "node:readline";
import { MODELS_FOLDER, PROGRAM } from "./paths";

export interface ServiceOptions {
  /** Settings beside those that all tests share. */
  settings?: Record<string, string | number | boolean>;
  /** Without models it answers nothing. */
  hasModels?: boolean;
  /** Without a data directory it keeps nothing. */
  hasData?: boolean;
  /** Where it keeps things, if not in a temporary folder. */
  dataFolder?: string;
}

/** More are refused. */
const FRAMES_A_CALL = 16;

/** What a key of the service is told as. */
export interface MadeKey {
  name: string;
  role: string;
  key: string;
}

/** A service of its own, with its models and data in a temporary folder. */
export class Service {
  /** Where it listens, without a slash at the end. */
  url = "";
  /** Sent with all calls of the test. */
  key: string | undefined;
  private process: ChildProcess | undefined;

  private constructor(
    readonly folder: string,
    private readonly options: ServiceOptions,
  ) {}

  static async start(options: ServiceOptions = {}): Promise<Service> {
    const folder = await mkdtemp(join(tmpdir(), "roomsight-page-"));
    const service = new Service(folder, options);
    await cp(MODELS_FOLDER, service.models, {
      recursive: true,
      filter: (from) => (options.hasModels ?? true) || from === MODELS_FOLDER,
    });
    await service.run();
    return service;
  }

  get models(): string {
    return join(this.folder, "models");
  }

  get data(): string {
    return this.options.dataFolder ?? join(this.folder, "data");
  }

  /** Starts it, where it was before if it was stopped. */
  async run(): Promise<void> {
    const { settings = {}, hasData = true } = this.options;
    const listen = this.url === "" ? "127.0.0.1:0" : new URL(this.url).host;
    const shared = { log_format: "json", threads: 1, models_poll_ms: 200 };
    const set = Object.entries({ ...shared, ...settings }).flatMap(([name, value]) => [
      "--set",
      `${name}=${value}`,
    ]);
    const data = hasData ? ["--data", this.data] : [];
    const started = spawn(
      PROGRAM,
      ["serve", "--models", this.models, ...data, "--listen", listen, ...set],
      { stdio: ["ignore", "pipe", "pipe"], cwd: this.folder },
    );
    this.process = started;
    this.url = await addressOf(started);
  }

  /** Ends it and keeps what it has kept. */
  async stop(signal: NodeJS.Signals = "SIGTERM"): Promise<void> {
    const { process } = this;
    if (!process || process.exitCode !== null || process.signalCode !== null) return;
    const ended = once(process, "exit");
    process.kill(signal);
    await ended;
  }

  async remove(): Promise<void> {
    await this.stop("SIGKILL");
    await rm(this.folder, { recursive: true, force: true });
  }

  /** Calls it as a program would; throws where it refuses. */
  async call<T>(method: string, path: string, body?: unknown): Promise<T> {
    const isPlain = body === undefined || body instanceof FormData || body instanceof Uint8Array;
    const headers: Record<string, string> = isPlain ? {} : { "content-type": "application/json" };
    if (this.key !== undefined) headers.authorization = `Bearer ${this.key}`;
    const response = await fetch(`${this.url}/v1/${path}`, {
      method,
      headers,
      body: isPlain ? (body as BodyInit) : JSON.stringify(body),
    });
    const answer = await response.text();
    if (!response.ok) throw new Error(`${method} ${path}: ${response.status} ${answer}`);
    return (answer === "" ? undefined : JSON.parse(answer)) as T;
  }

  /** Sends a frame in the name of a robot. */
  async recognize(robot: string, frame: string | Uint8Array): Promise<Answer> {
    const picture = typeof frame === "string" ? await readFile(frame) : frame;
    return await this.call("POST", `recognize?robot=${encodeURIComponent(robot)}`, picture);
  }

  /** Makes a data set of files that lie as `room/drive/file`. */
  async makeSet(set: string, files: readonly string[]): Promise<void> {
    await this.call("PUT", `sets/${set}`);
    for (const drive of new Set(files.map((file) => dirname(file)))) {
      const query = new URLSearchParams({ room: basename(dirname(drive)), drive: basename(drive) });
      const pictures = files.filter((file) => dirname(file) === drive);
      for (let first = 0; first < pictures.length; first += FRAMES_A_CALL) {
        const form = new FormData();
        for (const file of pictures.slice(first, first + FRAMES_A_CALL)) {
          form.append("frame", new Blob([await readFile(file)]), basename(file));
        }
        await this.call("POST", `sets/${set}/frames?${query}`, form);
      }
    }
  }

  /** Makes a key of each role; from then on the test calls as the admin. */
  async makeKeys(): Promise<Record<"admin" | "viewer" | "robot", string>> {
    const make = async (role: string) =>
      (await this.call<MadeKey>("POST", "keys", { name: `${role}-key`, role })).key;
    const admin = await make("admin");
    this.key = admin;
    return { admin, viewer: await make("viewer"), robot: await make("robot") };
  }
}

/** What a test reads of an answer. */
export interface Answer {
  room: string;
  known: boolean;
  probability: number;
}

/** Where it listens, as it says when it does. */
async function addressOf(process: ChildProcess): Promise<string> {
  const said: string[] = [];
  const { stdout, stderr } = process;
  if (!stdout || !stderr) throw new Error("the program has no output");
  stdout.resume();
  // It is read to the end, or the program would wait for somebody to read it.
  const lines = createInterface(stderr);
  return await new Promise((resolve, reject) => {
    lines.on("line", (line) => {
      said.push(line);
      const address = /listening on (http:\/\/[\d.:]+)/.exec(line)?.[1];
      if (address !== undefined) resolve(address);
    });
    process.once("exit", () => reject(new Error(`the service ended:\n${said.join("\n")}`)));
  });
}
