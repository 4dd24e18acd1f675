/** Texts of the frame around the pages, and of parts that all pages use. */
export const text = {
  product: "roomsight",
  skip: "Skip to content",
  pages: "Pages",
  live: "Live",
  try: "Try",
  teach: "Teach",
  inbox: "Inbox",
  models: "Models",
  service: "Service",

  close: "Close",
  cancel: "Cancel",
  ok: "OK",
  retry: "Try again",
  reload: "Reload the page",
  undo: "Undo",
  loading: "Loading …",
  more: "More",
  nothing: "–",
  signIn: "Sign in",
  signOut: "Sign out",
  signInTitle: "Sign in to roomsight",
  signInLead:
    "This service asks for a key. It is kept by the browser only as long as you are signed in.",
  signInAgain:
    "You are signed out: the session ended, or its key was revoked. Sign in to go on where you were.",
  key: "Key",
  keyHint: "As roomsight key new printed it, or another admin gave it to you: rs_…",
  keyMissing: "Enter a key.",
  codeFailed:
    "This one-time code is used up or too old. Run roomsight serve --lan again, or sign in with a key.",
  signingIn: "Signing in …",
  signedInAs: (name: string, role: string) => `${name} (${role})`,
  openService: "No keys: everyone who reaches this page may do everything.",
  expiresIn: (duration: string) => `Signed in for ${duration} more`,
  needsRole: (role: string) => `Only a key with the role ${role} may do this.`,
  noData:
    "This service has no data directory, so it cannot keep pictures. Start it with roomsight serve --data FOLDER.",

  unreachable: "No answer",
  unreachableDetail: "The service does not answer. Is it running, and is the network up?",
  refused: (status: number, reason: string) => `The service answered ${status} ${reason}`.trim(),
  pageFailed:
    "This page could not be loaded. The service may have been updated since it was opened.",
  partFailed: "Something in this page failed.",
  pictureMissing: "No picture",

  theme: "Appearance",
  themeSystem: "As the system",
  themeLight: "Light",
  themeDark: "Dark",

  cameraInsecure:
    "Browsers give pages a camera only over HTTPS or on localhost. Start the service with roomsight serve --lan and open the address that it prints.",
  cameraDenied:
    "The browser was not allowed to use the camera. Allow it in the settings of this page (beside the address), then try again.",
  cameraNone: "No camera was found.",
  cameraBusy: "The camera could not be started. Another program may be using it.",
  cameraFailed: (reason: string) => `The camera could not be started: ${reason}`,
  cameraChoose: "Camera",
  cameraNumber: (n: number) => `Camera ${n}`,

  known: "Known",
  notKnown: "Not known",
  elsewhere: "elsewhere",
  reasons: {
    unsure: "unsure which room",
    new_place: "looks like no place that was trained",
    no_detail: "too little detail in the frame",
    dark: "too dark",
    covered: "camera covered",
  },
  stages: { queue: "Queue", decode: "Decode", features: "Features", classify: "Classify" },
};
