import type { ComponentChildren } from "preact";

/** A table that scrolls by itself where it is too wide, also by keyboard. */
export function Table(props: {
  label: string;
  head: string[];
  rows: { key: string; cells: ComponentChildren[] }[];
  /** Which columns are numbers. */
  numbers?: number[];
}) {
  const numbers = new Set(props.numbers);
  const kind = (column: number) => (numbers.has(column) ? "num" : undefined);
  return (
    <div class="table-wrap" tabIndex={0} role="group" aria-label={props.label}>
      <table class="table">
        <thead>
          <tr>
            {props.head.map((name, column) => (
              <th key={name} class={kind(column)} scope="col">
                {name}
              </th>
            ))}
          </tr>
        </thead>
        <tbody>
          {props.rows.map(({ key, cells }) => (
            <tr key={key}>
              {cells.map((cell, column) => (
                <td key={props.head[column]} class={kind(column)}>
                  {cell}
                </td>
              ))}
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}
