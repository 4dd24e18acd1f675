import type { Bin } from "../../api/trainings";
import { percent } from "../../format";
import { text } from "../../texts/models";
import { dots } from "./charts";
import type { Described } from "./subject";

const SIDE = 220;
const LEFT = 40;
const TOP = 10;
const TICKS = [0, 0.5, 1];

/** How often answers of a probability were right: probabilities that keep their word lie on the diagonal. */
export function Reliability({ described }: { described: Described[] }) {
  const bins = described.map(({ report }) => report?.verdict.knowledge.reliability ?? []);
  return (
    <figure class="reliability">
      <svg
        viewBox={`0 0 ${LEFT + SIDE + 24} ${TOP + SIDE + 40}`}
        role="img"
        aria-label={`${text.reliability}: ${bins.map(told).join("; ")}`}
      >
        <g transform={`translate(${LEFT} ${TOP})`}>
          <rect class="plot" width={SIDE} height={SIDE} />
          <line class="diagonal" x1="0" y1={SIDE} x2={SIDE} y2="0" />
          {TICKS.map((tick) => (
            <g key={tick}>
              <text x={tick * SIDE} y={SIDE + 16} text-anchor="middle">
                {percent(tick)}
              </text>
              <text x="-6" y={(1 - tick) * SIDE + 4} text-anchor="end">
                {percent(tick)}
              </text>
            </g>
          ))}
          <text x={SIDE / 2} y={SIDE + 34} text-anchor="middle">
            {text.reliabilityAxisX}
          </text>
          {bins.map((of, index) => (
            <Series key={index} bins={of} index={index} />
          ))}
        </g>
      </svg>
      {described.length > 1 && (
        <figcaption class="row small">
          {described.map(({ label }, index) => (
            <span key={label} class={`legend subject-${index}`}>
              <span class="mark" aria-hidden="true" />
              {label}
            </span>
          ))}
        </figcaption>
      )}
    </figure>
  );
}

const told = (bins: Bin[]) =>
  bins
    .map(({ probability, rate }) =>
      text.reliabilityDot(percent(probability), percent(rate.rate), rate.n_frames),
    )
    .join(", ");

/** The bins of one model: circles of the first, squares of the second. */
function Series({ bins, index }: { bins: Bin[]; index: number }) {
  const all = dots(bins, SIDE);
  return (
    <g class={`series subject-${index}`}>
      <polyline points={all.map(({ x, y }) => `${x},${y}`).join(" ")} />
      {all.map(({ x, y, radius, bin }) => (
        <g key={bin.probability}>
          <title>
            {text.reliabilityDot(
              percent(bin.probability),
              percent(bin.rate.rate),
              bin.rate.n_frames,
            )}
          </title>
          {index === 0 ? (
            <circle cx={x} cy={y} r={radius} />
          ) : (
            <rect x={x - radius} y={y - radius} width={2 * radius} height={2 * radius} />
          )}
        </g>
      ))}
    </g>
  );
}
