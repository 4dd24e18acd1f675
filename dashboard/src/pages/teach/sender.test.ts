import { expect, it, vi } from "vitest";
import { Sender, type Judgment, type SenderState } from "./sender";

/** A sender whose parcels fail as told: a parcel's first attempts end with these judgments. */
function sender(failures: Record<string, Judgment["then"][]> = {}, capacity = 3) {
  const sent: string[] = [];
  const dropped: string[] = [];
  const states: SenderState[] = [];
  const made = new Sender<string>({
    capacity,
    send: async (parcel) => {
      await Promise.resolve();
      const then = failures[parcel]?.shift();
      if (then !== undefined) {
        throw new Error(then);
      }
      sent.push(parcel);
    },
    judge: (error) => ({ then: (error as Error).message as Judgment["then"], reason: "because" }),
    dropped: (parcel) => dropped.push(parcel),
    changed: (state) => states.push(state),
    sleep: () => Promise.resolve(),
  });
  return { made, sent, dropped, states };
}

it("parcels are sent in order", async () => {
  const { made, sent } = sender();
  expect(["a", "b", "c"].map((parcel) => made.offer(parcel))).toEqual([true, true, true]);
  await made.empty();
  expect(sent).toEqual(["a", "b", "c"]);
  expect(made.state).toEqual({ waiting: 0, sent: 3 });
});

it("no more wait than there is room for", async () => {
  const { made, sent } = sender({}, 2);
  expect(["a", "b", "c"].map((parcel) => made.offer(parcel))).toEqual([true, true, false]);
  await made.empty();
  expect(made.offer("d")).toBe(true);
  await made.empty();
  expect(sent).toEqual(["a", "b", "d"]);
});

it("a connection that breaks loses nothing", async () => {
  const { made, sent, states } = sender({ a: ["again", "again"] });
  made.offer("a");
  made.offer("b");
  await made.empty();
  expect(sent).toEqual(["a", "b"]);
  expect(states.some(({ held }) => held?.then === "again")).toBe(true);
  expect(made.state.held).toBeUndefined();
});

it("a full disk stops, and goes on with what waited", async () => {
  const { made, sent } = sender({ a: ["stop"] });
  made.offer("a");
  made.offer("b");
  await vi.waitFor(() => expect(made.state.held?.then).toBe("stop"));
  expect(made.state.waiting).toBe(2);
  expect(made.offer("c")).toBe(false);
  made.resume();
  await made.empty();
  expect(sent).toEqual(["a", "b"]);
});

it("what can never be sent is told and does not hold up the others", async () => {
  const { made, sent, dropped } = sender({ a: ["drop"] });
  made.offer("a");
  made.offer("b");
  await made.empty();
  expect(sent).toEqual(["b"]);
  expect(dropped).toEqual(["a"]);
});

it("a closed sender takes and keeps nothing", async () => {
  const { made } = sender();
  made.offer("a");
  made.close();
  await made.empty();
  expect(made.offer("b")).toBe(false);
  expect(made.state.waiting).toBe(0);
});
