import { plural } from "../format";

const frames = (n: number) => plural(n, "frame");
const rooms = (n: number) => plural(n, "room");

/** Texts of the page Teach. */
export const text = {
  title: "Teach",
  lead: "A data set holds the pictures that a model learns rooms from. Record your rooms with a camera, or add pictures that you have.",
  frames,
  rooms,
  drives: (n: number) => plural(n, "drive"),

  newSet: "New data set",
  setName: "Name",
  setNameHint: "Letters, digits, - _ and . such as home",
  setNameWrong:
    "Use letters, digits, - _ and . only, at most 64, and begin with a letter or a digit.",
  create: "Create",
  noSets: "No data sets yet",
  noSetsText:
    "Create one, then record each room with the camera of a phone, a laptop or a robot. Forty different pictures a room are a good start.",
  changedAt: (at: string) => `Changed ${at}`,
  removeSet: "Remove data set",
  removeSetTitle: (name: string) => `Remove ${name}?`,
  removeSetText: (n: number) =>
    `${frames(n)} will no longer be in the page. The service keeps the folder for a while in its data directory under removed/.`,
  setRemoved: (name: string) => `${name} was removed.`,

  back: "Data sets",
  record: "Record a room",
  addPictures: "Add pictures",
  train: "Train",
  tabs: { frames: "Frames", check: "Check", changes: "Changes" },
  tabsLabel: "Of the data set",
  advice: "What is missing",
  leftOut: (n: number) => `${plural(n, "file")} left out`,
  emptySet: "No pictures yet",
  emptySetText:
    "Walk through each room with the camera, or drop a folder here that has a folder for each room.",

  allRooms: "All rooms",
  roomsLabel: "Rooms",
  elsewhereHint: "Pictures of no room, such as the stairwell: they teach what is not known.",
  dropToNewRoom: "Drop frames here for a new room",
  drive: "Drive",
  allDrives: "All drives",
  renameRoom: "Rename room",
  renameDrive: "Rename drive",
  removeRoom: "Remove room",
  rename: "Rename",
  newName: "New name",
  mergeHint: (name: string) => `There is a room ${name}: both become one.`,
  renameHint: "The name of another room puts both together.",
  removeRoomTitle: (room: string) => `Remove ${room}?`,
  removeRoomText: (n: number) => `${frames(n)} go with it. This can be undone.`,

  gridLabel: (room: string, n: number) => `${room}, ${frames(n)}`,
  gridHelp:
    "Click, Shift or Ctrl to select. Keys: arrows, Space to select, Shift with arrows for more, Ctrl+A for all, M to move, Delete to remove, Enter to look.",
  frameLabel: (room: string, drive: string, name: string) => `${room}, ${drive}, ${name}`,
  selected: (n: number) => `${n.toLocaleString("en")} selected`,
  nothingSelected: "Nothing selected",
  selectAll: "Select all",
  selectNone: "Select none",
  move: "Move …",
  moveTitle: (n: number) => `Move ${frames(n)} to`,
  moveNew: "A new room",
  moveHere: "Move",
  moveDrive: "Drive",
  moveDriveHint: "Left empty, frames keep the name of their drive.",
  roomName: "Name of the room",
  remove: "Remove",

  changesLead:
    "What was done to this data set, the last first. Later changes are undone before earlier ones.",
  noChanges: "Nothing was changed yet.",
  when: "When",
  who: "Who",
  what: "What",
  undone: "Undone",
  undoDone: (what: string) => `Undone: ${what}`,

  checkLead:
    "The check compares all pictures: copies, labels that the others contradict, blurred and dark ones. It takes a minute or so for a few hundred pictures.",
  checkStart: "Check now",
  checkAgain: "Check again",
  checkRunning: (n: number | undefined) =>
    n === undefined ? "Checking …" : `Checking ${frames(n)} …`,
  checkedAt: (at: string, n: number) => `Checked ${at}: ${frames(n)}.`,
  checkNothing: "Nothing odd was found.",
  checkFound: (n: number) => `${plural(n, "picture")} to look at.`,
  checkMore: (n: number) => `Show ${n.toLocaleString("en")} more`,
  checkFailed: "The check failed",
  checkStale: "The data set has changed since.",
  findingRoom: (room: string) => `said to show ${room}`,
  moveTo: (room: string) => `Move to ${room}`,
  keep: "It is right",
  otherOf: (path: string) => `A copy of ${path}`,

  uploadTitle: "Add pictures",
  uploadLead:
    "Drop pictures or folders here. Of a folder, the folders in it are rooms, and those within are drives: kitchen/monday/0001.jpg.",
  choosePictures: "Choose pictures",
  chooseFolder: "Choose a folder",
  uploadReading: "Reading the folder …",
  uploadInto: "Room",
  uploadIntoHint: "For pictures that lie in no folder.",
  uploadDrive: "Drive",
  uploadDriveHint:
    "Pictures of one walk or day belong together: training tests itself on whole drives.",
  uploadLevel: "Rooms are the folders",
  uploadLevelOf: (names: string) => `like ${names}`,
  uploadPlan: (n: number, size: string) => `${plural(n, "picture")}, ${size}`,
  uploadStart: (n: number) => `Add ${plural(n, "picture")}`,
  uploadProgress: (done: number, n: number) =>
    `${done.toLocaleString("en")} of ${plural(n, "picture")}`,
  uploadAdded: (n: number) => `${plural(n, "picture")} added.`,
  uploadCopies: (n: number) => `${plural(n, "picture")} there already.`,
  uploadRefused: (n: number) => `${plural(n, "file")} refused:`,
  uploadLeave: "Pictures that are not sent yet would not be added. What was added stays.",
  uploadStop: "Stop adding",
  uploadNoRoom: "Name the room.",
  goOn: "Go on",
  again: "Trying again …",
  done: "Done",

  trainTitle: (set: string) => `Train on ${set}`,
  trainLead:
    "Training runs in the background, one at a time, and goes on if you close this page. Nothing serves before you say so.",
  trainModel: "Model",
  trainModelHint: "What is trained can become the next version of this model.",
  trainEffort: "Effort",
  trainEfforts: {
    fast: "Fast: a few milliseconds a frame, the least sure",
    default: "Default",
    best: "Best: takes longest, and more for each frame",
  },
  trainCamera: "Camera",
  trainCameras: {
    "": "Tell by the pictures",
    perspective: "Ordinary (perspective)",
    equirectangular: "Panorama (equirectangular)",
    omnidirectional: "Mirror (omnidirectional)",
  },
  trainTooFew: "A model tells rooms apart: record at least two rooms first.",
  trainStart: "Start training",

  recordTitle: "Record a room",
  recordRoom: "Which room?",
  recordRoomHint:
    "Such as kitchen. Recording a room again at another time of day makes the model surer.",
  recordThere: (n: number) =>
    `${frames(n)} there already. Another walk at another time of day makes the model surer.`,
  recordStart: "Start the camera",
  recordTaking: "Recording",
  recordPaused: "Paused",
  recordPause: "Pause",
  recordResume: "Go on",
  recordFinish: "Finish",
  recordTaken: (n: number) => `${n.toLocaleString("en")} taken`,
  recordOf: (n: number) => `of ${n}`,
  recordTips:
    "Walk slowly through the whole room, along its walls and once through the middle, at the height of the robot's camera. A frame is taken whenever the view has changed.",
  recordSay: {
    taken: "Good. Keep going.",
    same: "Seen already. Turn or walk on.",
    blurred: "Blurred. Move a little slower.",
    dark: "Too dark to see anything.",
    plenty: "That is plenty. Finish, and record the next room.",
  },
  recordWaiting: "Wait: pictures are still on their way.",
  recordStarting: "Starting the camera …",
  recordMore: (n: number) => `${n} more different views are enough.`,
  recordEnough: "Enough. A few more from other corners still help.",
  recordPlenty: "Plenty.",
  recordAway: (waiting: number) =>
    waiting === 0 ? "All of it is kept." : `${plural(waiting, "picture")} on the way.`,
  recordOffline:
    "The service does not answer. Pictures wait here and are sent as soon as it does; keep this page open.",
  recordStopped: "Recording stopped. What was kept is safe; what waits is sent when you go on.",
  recordTryAgain: "Try again",
  recordRefused: (n: number, reason: string) => `${plural(n, "picture")} refused: ${reason}`,
  recordFinished: (room: string, n: number) => `${room}: ${frames(n)} recorded.`,
  recordNext: "Record another room",
  recordSee: "See the frames",
  recordSummary: (n: number, drive: string) => `${frames(n)} in the drive ${drive}.`,
  recordVideo: "What the camera sees",
};
