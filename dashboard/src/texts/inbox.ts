/** Texts of the page Inbox. */
export const text = {
  title: "Inbox",
};
