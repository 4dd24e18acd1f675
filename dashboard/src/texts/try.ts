/** Texts of the page Try. */
export const text = {
  title: "Try",
};
