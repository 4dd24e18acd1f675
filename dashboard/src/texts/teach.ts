/** Texts of the page Teach. */
export const text = {
  title: "Teach",
};
