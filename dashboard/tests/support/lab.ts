import { readFile } from "node:fs/promises";
import { darkness, framesOf, MODEL, OTHER_ROOM, ROOM } from "./frames";
import { Robots } from "./robots";
import { Service } from "./service";

interface Training {
  id: number;
  state: string;
}

/** All that robots send is kept. */
const RULE = {
  ...{ all: true, robots: [], keys: [], every_s: 0, probability: 1 },
  ...{ max_frames: 1000, max_bytes: 2 ** 28, max_days: 7 },
};

/** A service that has been in use for a while: robots, some of them lost, a data set, a full inbox, a shadow. */
export class Lab {
  private constructor(
    readonly service: Service,
    private readonly robots: Robots,
  ) {}

  static async open(): Promise<Lab> {
    const service = await Service.start({ settings: { lost_after_ms: 1000 } });
    try {
      await Lab.use(service);
    } catch (error) {
      await service.remove();
      throw error;
    }
    return new Lab(service, Robots.drive(service, { robots: 3, rate: 1 }));
  }

  private static async use(service: Service): Promise<void> {
    const frames = [];
    for (const room of [ROOM, OTHER_ROOM, "bathroom", "one-person office"]) {
      for (const drive of ["cloudy1", "cloudy2"]) {
        frames.push(...(await framesOf(room, drive)).slice(0, 6));
      }
    }
    await service.makeSet("home", frames);
    const asked = { set: "home", model: MODEL, effort: "fast" };
    const { id } = await service.call<Training>("POST", "trainings", asked);
    await service.call("PUT", "inbox/rule", RULE);
    for (const [at, frame] of (await framesOf("*", "cloudy2")).slice(0, 40).entries()) {
      await service.recognize(`robot-${at % 5}`, frame);
    }
    for (const frame of (await framesOf(OTHER_ROOM, "cloudy2")).slice(8, 12)) {
      await service.call("POST", `inbox?robot=robot-1&right=${ROOM}`, await readFile(frame));
    }
    await service.recognize("lost-one", darkness());
    while ((await service.call<Training>("GET", `trainings/${id}`)).state === "running") {
      await service.recognize("lost-one", darkness());
    }
    await service.call("POST", `trainings/${id}/publish`, { even_if_worse: true });
    await service.call("PUT", `models/${MODEL}/labels/shadow`, { version: 2 });
  }

  async close(): Promise<void> {
    await this.robots.stop();
    await this.service.remove();
  }
}
