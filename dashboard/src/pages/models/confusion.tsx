import type { Evaluation } from "../../api/trainings";
import { text } from "../../texts/models";
import { shade } from "./charts";

/** How often each room was answered as each room. */
export function Confusion({ label, evaluation }: { label: string; evaluation: Evaluation }) {
  const { places, confusion } = evaluation;
  return (
    <div class="table-wrap" tabIndex={0} role="region" aria-label={`${text.confusion}: ${label}`}>
      <table class="confusion">
        <caption>{label}</caption>
        <thead>
          <tr>
            <th scope="col">
              <span class="hidden">{text.shown}</span>
            </th>
            {places.map((room) => (
              <th key={room} scope="col" class="answered" title={room}>
                <span>{room}</span>
              </th>
            ))}
          </tr>
        </thead>
        <tbody>
          {confusion.map((row, shown) => (
            <tr key={places[shown]}>
              <th scope="row" class="clip" title={places[shown]}>
                {places[shown]}
              </th>
              {row.map((n, answered) => (
                <td
                  key={places[answered]}
                  class={`${shown === answered ? "right" : "wrong"} shade-${shade(n, row)}`}
                  title={text.confusionCell(places[shown] ?? "", places[answered] ?? "", n)}
                >
                  {n > 0 ? n : ""}
                </td>
              ))}
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}
