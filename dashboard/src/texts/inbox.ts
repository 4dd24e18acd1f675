import { plural } from "../format";

const frames = (n: number) => plural(n, "frame");

/** Texts of the page Inbox. */
export const text = {
  title: "Inbox",
  lead: "Frames that robots sent and the model doubted. Say which rooms they show, and the next training learns from them.",
  frames,
  tabs: { frames: "Frames", rule: "What is kept", policy: "What follows" },
  tabsLabel: "Of the inbox",

  off: "No frames are kept: the inbox is switched off.",
  switchOn: "Choose what is kept",
  none: "Nothing to look at",
  noneText: "No frame fits these filters. Frames come as robots send what the model doubts.",
  fresh: (n: number) => `${frames(n)} came or went since.`,
  showFresh: "Show",

  filters: "Filters",
  state: "State",
  states: { open: "Open", labeled: "Labeled", all: "All" },
  reason: "Reason",
  anyReason: "Any reason",
  reasons: {
    unknown: "Not known",
    low: "Low probability",
    torn: "Torn between rooms",
    filter_apart: "Against the filter",
    shadow_apart: "Shadow disagrees",
    wrong: "Said to be wrong",
  },
  robot: "Robot",
  anyRobot: "Any robot",
  room: "Answered room",
  anyRoom: "Any room",
  sort: "Order",
  sorts: { value: "Teaches most first", newest: "Newest first" },

  gridLabel: (n: number) => `Inbox, ${frames(n)}`,
  frameLabel: (room: string, probability: string, reasons: string) =>
    `Answered ${room}, ${probability}; ${reasons}`,
  labeledAs: (room: string) => `Labeled ${room}`,
  gridHelp:
    "Keys: arrows, Space to select, Shift with arrows for more, Ctrl+A for all, 1 to 9 for a room, E for elsewhere, N for a new room, Delete to discard, Enter to look.",
  selected: (n: number) => `${n.toLocaleString("en")} selected`,
  focusedOnly: "The focused frame",
  labelAs: "It shows",
  labelBar: "Labels",
  set: "Data set",
  noSets: "There is no data set to put labeled frames into.",
  makeSet: "Create one in Teach",
  newRoom: "New room …",
  newRoomTitle: "A new room",
  roomName: "Name of the room",
  label: "Label",
  discard: "Discard",
  selectAll: "Select all",
  selectNone: "Select none",
  labeled: (n: number, room: string, set: string) => `${frames(n)} labeled ${room} in ${set}.`,
  discarded: (n: number) => `${frames(n)} discarded.`,
  discardTitle: (n: number) => `Discard ${frames(n)}?`,
  discardText: "They are deleted. This cannot be undone.",

  conflictsTitle: (n: number) =>
    n === 1 ? "One frame was not labeled" : `${n} frames were not labeled`,
  conflictsText:
    "Somebody else was faster. Nothing was overwritten; look at what they said before you label again.",
  conflictBy: (by: string, room: string, set: string) => `${by} says ${room} (${set})`,
  showLabeled: "Show labeled frames",

  panel: "The focused frame",
  said: (room: string) => `Somebody says that it shows ${room}.`,
  labelSaid: (room: string) => `Label it ${room}`,
  filteredRoom: (room: string) => `The frames before together say ${room}.`,
  shadowRoom: (room: string) => `The shadow says ${room}.`,
  labelOf: (room: string, set: string, by: string, at: string) =>
    `Labeled ${room} in ${set} by ${by}, ${at}`,
  from: (robot: string, at: string) => `${robot}, ${at}`,
  someRobot: "Without a name",
  byModel: (name: string, version: number) => `${name}/${version}`,
  teaches: (share: string) => `Would teach: ${share}`,
  enlarge: "Look closer",

  nearest: "Nearest training frames",
  nearestLead:
    "If one of these is in the wrong room, the training frame is what is wrong: move it here.",
  nearestNone: "The model names no training frames that are like it.",
  nearestOf: (room: string, nearness: string) => `${room}, ${nearness}`,
  moveTraining: "Move …",
  removeTraining: (frame: string) => `Remove the training frame ${frame}`,

  ruleLead:
    "Which frames are kept, of whom, and for how long. Only frames that the model doubts are kept, as pictures in the service's data directory. They may show people and what lies in the rooms: keep no more, and no longer, than you need. Nothing leaves this machine.",
  ruleWho: "Of whom",
  ruleOff: "Nobody (off)",
  ruleAll: "All robots",
  ruleSome: "Only these",
  ruleRobots: "Robots",
  ruleRobotsHint: "Names, separated by commas",
  ruleKeys: "Keys",
  ruleKeysHint: "Names of keys, separated by commas",
  ruleEvery: "At most one frame a robot every … seconds",
  ruleProbability: "Doubted below a probability of … %",
  ruleFrames: "At most … frames",
  ruleBytes: "At most … MiB",
  ruleDays: "Deleted after … days",
  ruleHolds: (n: number, size: string) => `It holds ${frames(n)} now, ${size}.`,
  ruleDrops: "Where there are more, the least telling and oldest go first.",
  ruleNeedsSome: "Name a robot or a key.",
  save: "Save",
  saved: "Saved.",

  policyLead:
    "What happens by itself once frames were labeled. By default nothing: you train and publish on the pages Teach and Models. However far it goes, a version that answers worse than the one that serves goes no further.",
  policyTrain: "Train by itself",
  policyAfter: "After … labeled frames",
  policyAfterHint: "Counted since the last training on the data set.",
  policySet: "Data set",
  policyModel: "Model",
  policyPublish: "How far a trained version goes by itself",
  policySteps: {
    nothing: "It waits for you",
    shadow: "Shadow: it sees what robots send and answers nobody",
    canary: "Canary: it answers a tenth of the robots",
    stable: "Stable: it answers all robots",
  },
  policyWarn: "Robots will act on answers of a version that nobody looked at.",
};
