/** Texts of parts that the pages Teach and Inbox share. */
export const text = {
  pictureMissing: "No picture",
};
