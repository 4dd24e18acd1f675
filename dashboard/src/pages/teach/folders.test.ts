import { describe, expect, it } from "vitest";
import { chunks, levelOfRooms, named, pictures, placed } from "./folders";

const files = (...paths: string[]) => paths.map((path) => ({ path, item: path }));
const where = (level: number, ...paths: string[]) =>
  placed(files(...paths), level, "unnamed", "upload").map(({ room, drive, name }) =>
    [room, drive, name].join(" | "),
  );

describe("the rooms of folders", () => {
  it("lie in the folder that was dropped", () => {
    const paths = ["home/kitchen/monday/1.jpg", "home/kitchen/2.jpg", "home/bath/3.jpg"];
    const level = levelOfRooms(paths);
    expect(level).toBe(1);
    expect(where(level, ...paths)).toEqual([
      "kitchen | monday | 1.jpg",
      "kitchen | upload | 2.jpg",
      "bath | upload | 3.jpg",
    ]);
  });

  it("are the folders that were dropped, where there are several", () => {
    expect(levelOfRooms(["kitchen/1.jpg", "bath/tuesday/2.jpg"])).toBe(0);
  });

  it("may be one", () => {
    expect(levelOfRooms(["kitchen/1.jpg", "kitchen/2.jpg"])).toBe(0);
    expect(where(0, "kitchen/1.jpg")).toEqual(["kitchen | upload | 1.jpg"]);
  });

  it("are chosen where there are no folders", () => {
    expect(levelOfRooms(["1.jpg", "2.jpg"])).toBe(0);
    expect(levelOfRooms([])).toBe(0);
    expect(where(0, "1.jpg")).toEqual(["unnamed | upload | 1.jpg"]);
  });

  it("may have deep drives", () => {
    expect(where(0, "hall/week 1/monday/1.jpg")).toEqual(["hall | week 1-monday | 1.jpg"]);
  });
});

it("what systems leave is no picture", () => {
  const left = pictures(
    files("a/.DS_Store", "a/@eaDir/1.jpg", "a/Thumbs.db", "__MACOSX/a/1.jpg", "a/1.jpg"),
  );
  expect(left.map(({ path }) => path)).toEqual(["a/1.jpg"]);
});

it("names cannot lead elsewhere", () => {
  expect(named("..")).toBe("unnamed");
  expect(named("a/b\\c\n")).toBe("a-b-c-");
  expect(named(" Küche <b> ")).toBe("Küche -b-");
  expect(named("..a room. ")).toBe("a room");
});

it("chunks are of one drive and not too large", () => {
  const of = (drive: string, item: number) => ({ room: "hall", drive, name: String(item), item });
  const all = [
    of("a", 1),
    of("a", 2),
    of("a", 9),
    of("a", 1),
    of("b", 1),
    of("b", 1),
    of("b", 1),
    of("b", 1),
  ];
  const sizes = chunks(all, (item) => item, { files: 3, bytes: 5 }).map((chunk) =>
    chunk.map(({ item }) => item),
  );
  expect(sizes).toEqual([[1, 2], [9], [1], [1, 1, 1], [1]]);
});
