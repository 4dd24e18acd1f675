/** Texts of the page Service. */
export const text = {
  title: "Service",
};
