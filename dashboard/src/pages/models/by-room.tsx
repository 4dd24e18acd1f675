import { percent } from "../../format";
import { text } from "../../texts/models";
import { ratesByRoom } from "./charts";
import { Difference } from "./difference";
import type { Described } from "./subject";

/** Bars of how often each room was answered right. */
export function ByRoom({ described }: { described: Described[] }) {
  const rooms = ratesByRoom(described.map(({ report }) => report?.held_out));
  const hasTwo = described.length > 1;
  return (
    <div class="table-wrap" tabIndex={0} role="region" aria-label={text.byRoom}>
      <table class="table by-room">
        <thead>
          <tr>
            <th scope="col">{text.room}</th>
            {described.map(({ label }) => (
              <th key={label} scope="col">
                {label}
              </th>
            ))}
            {hasTwo && (
              <th scope="col" class="num">
                {text.difference}
              </th>
            )}
          </tr>
        </thead>
        <tbody>
          {rooms.map(({ room, rates }) => (
            <tr key={room}>
              <th scope="row" class="clip">
                {room}
              </th>
              {rates.map((rate, index) => (
                <td key={index}>
                  {rate && (
                    <div class={`bar subject-${index}`} title={text.ofN(rate.n_frames)}>
                      <div class="track" aria-hidden="true">
                        <div class="fill" style={{ transform: `scaleX(${rate.rate ?? 0})` }} />
                      </div>
                      <span class="number">
                        {percent(rate.rate)}
                        {!hasTwo && <span class="muted"> {text.ofN(rate.n_frames)}</span>}
                      </span>
                    </div>
                  )}
                </td>
              ))}
              {hasTwo && (
                <td class="num">
                  <Difference before={rates[0]} now={rates[1]} />
                </td>
              )}
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}
