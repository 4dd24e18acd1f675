import { plural } from "../format";

/** Texts of the page Live. */
export const text = {
  title: "Live",
  views: "What to show",
  robots: "Robots",
  rooms: "Rooms",
  map: "Map",
  search: "Find a robot or a room",
  state: "State",
  states: { all: "All", lost: "Lost", unknown: "Not known", left: "Left" },

  feed: {
    connecting: "Connecting …",
    open: "Live",
    polling: "Live, every 2 s",
    broken: "Connection lost, trying again …",
  },
  missed: (n: number) => `${plural(n, "update")} missed`,
  missedMore:
    "This page or its network was too slow for all changes; what is shown is right again.",
  counts: (n: number, lost: number, left: number) =>
    [
      plural(n, "robot"),
      lost > 0 ? `${lost} lost` : "none lost",
      left > 0 ? `${left} left` : undefined,
    ]
      .filter(Boolean)
      .join(" · "),

  lostNow: (lost: number) => `${plural(lost, "robot")} lost`,
  none: "No robots yet",
  noneMore:
    "A robot appears here with its first frame: over a stream, or with its name in a request. To see how an answer looks without one, point this device's camera at a room.",
  noneExample: "To send a frame as a robot:",
  openTry: "Try with this camera",
  noneChosen: "No robot fits",
  noneChosenMore: "Nothing here has that name, room or state now.",
  showAll: "Show all",

  frameOf: (id: string) => `What ${id} saw last`,
  noFrame: "No frame kept",
  framesNotKept: "Last frames are not kept",
  ribbonOf: (minutes: number, rooms: string) =>
    `Rooms of the last ${minutes} minutes, newest first: ${rooms || "none"}`,
  stretch: (room: string, known: boolean, from: string, until: string) =>
    `${room}${known ? "" : " (not known)"}, ${from} to ${until}`,
  wrongOf: (room: string, id: string) => `Wrong: ${room} of ${id}`,
  lost: "Lost",
  lostFor: (duration: string) => `Lost for ${duration}`,
  left: "Left",
  seenAgo: (duration: string) => `Last seen ${duration} ago`,
  inRoomFor: (duration: string) => `Here for ${duration}`,
  perSecond: (n: string) => `${n} frames/s`,
  age: (age: string) => `age ${age}`,
  latency: (latency: string) => `answered in ${latency}`,
  latencyMore: "From a frame’s arrival to its answer; its frames do not say when they were taken",
  ageMore: "Age of the last answer: from when the frame was taken to its answer",
  dropped: (n: number) => `${n.toLocaleString("en")} dropped`,
  noneDropped: "none dropped",
  dropReasons: {
    superseded: "a newer frame came first",
    deadline: "waited too long",
    overload: "too much at once",
    draining: "the service stopped",
    sampled: "between two samples",
  } as Record<string, string>,
  viaRest: "single requests",
  viaStream: "stream",

  graph: "Rooms and the ways between them",
  graphMore:
    "Lines are ways that robots took in training, thicker where more often. Robots stand at the room they are in; hollow ones are not known there.",
  noGraph: "No rooms to draw",
  noGraphMore: "The model that serves does not say how its rooms lie to each other.",
  model: "Model",
  moreRobots: (n: number) => `+${n}`,
  robotIn: (id: string, room: string, state: string) => `${id}: ${room}, ${state}`,
  positions: "Where training frames were taken",
  positionsMore:
    "Dots are training frames, in the color of their room. A robot stands where its last frame was probably taken, or amid its room.",
  noPositions: "No positions",
  noPositionsMore:
    "The training frames of this model came without poses, so there is no map to draw. The rooms as a graph are beside it.",
  meters: (n: number) => `${n} m`,

  back: "All robots",
  notThere: (id: string) => `${id} is not here`,
  notThereMore: "It never sent a frame, or left more than an hour ago.",
  answerTitle: "Answer",
  frameTitle: "Last frame",
  explain: "Explain this frame",
  explainMore:
    "Draws what spoke for and against the room, and shows the training frames that are most like it.",
  explainNext: "Explain the newest",
  minutesAgo: (minutes: number) => `${minutes} min ago`,
  now: "now",
  explainStop: "Back to live",
  explainOld: "The frame as it was when it was explained; its robot goes on.",
  newPlace: (share: string) => `Probability of a place that was never trained: ${share}`,
  pastTitle: "The last ten minutes",
  numbersTitle: "Numbers",
  answersTitle: "Last answers",
  mapTitle: "Where it is",
  seq: "Frame",
  room: "Room",
  known: "Known",
  probability: "Probability",
  ago: "Ago",
  total: "Total",
  yes: "yes",
  no: "no",
  numbers: {
    model: "Model",
    via: "Sends by",
    key: "Key",
    mode: "Mode",
    rate: "Frames a second",
    age: "Age of the answer",
    latency: "Latency",
    accepted: "Frames taken in",
    results: "Answered",
    errors: "Errors",
    dropped: "Dropped",
    streaming: "Streaming for",
    inRoom: "In this room for",
  },
};
