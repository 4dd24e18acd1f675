/** Texts of parts that the pages Teach and Inbox share. */
export const text = {
  pictureMissing: "No picture",
  frame: (name: string) => `The frame ${name}`,
  previous: "Previous",
  next: "Next",
  position: (at: number, of: number) => `${at.toLocaleString("en")} of ${of.toLocaleString("en")}`,
};
