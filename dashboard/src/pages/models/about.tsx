import type { Card } from "../../api/trainings";
import { count, dateTime, percent } from "../../format";
import { href } from "../../route";
import { text } from "../../texts/models";
import { trainingHref } from "./paths";
import type { Described } from "./subject";

/** Drives that are named; the rest is counted. */
const NAMED = 12;

interface AboutProps {
  described: Described;
  /** Whether it stands beside another. */
  hasLabel: boolean;
}

/** What a model was trained on, and how its opinions were chosen. */
export function About({ described, hasLabel }: AboutProps) {
  const { label, card, report, training } = described;
  return (
    <div class="stack about">
      {hasLabel && <h3>{label}</h3>}
      {card?.description && <p>{card.description}</p>}
      <dl class="facts">
        {training && (
          <>
            <dt>{text.trainedOn}</dt>
            <dd>
              <a href={href("teach", training.set)}>{training.set}</a>{" "}
              <a class="small" href={trainingHref(training.id)}>
                {text.trainingOf(training.id)}
              </a>
            </dd>
            <dt>{text.trainedAt}</dt>
            <dd>{dateTime(training.ended_at ?? training.began_at)}</dd>
          </>
        )}
        {card && (
          <>
            <dt>{text.nFrames}</dt>
            <dd class="number">{count(card.n_frames)}</dd>
            {card.sequences.length > 0 && (
              <>
                <dt>{text.drives}</dt>
                <dd>{drivesOf(card)}</dd>
              </>
            )}
            {card.measured.map(({ data, n_frames, rate }) => (
              <MeasuredRow key={data} data={data} n={n_frames} rate={rate} />
            ))}
            <dt>{text.trainedBy}</dt>
            <dd>
              {card.trained_by}
              {card.simulated && `, ${text.simulated.toLowerCase()}`}
            </dd>
          </>
        )}
      </dl>
      {card?.choice && <Choice choice={card.choice} />}
      {!report && <p class="muted">{text.noReport}</p>}
    </div>
  );
}

function drivesOf({ sequences }: Card): string {
  const named = sequences.slice(0, NAMED).join(", ");
  const more = sequences.length - NAMED;
  return more > 0 ? `${named} + ${more}` : named;
}

function MeasuredRow({ data, n, rate }: { data: string; n: number; rate: number }) {
  return (
    <>
      <dt>{text.right}</dt>
      <dd class="number">
        {percent(rate)} <span class="muted">{text.ofN(n)}</span> {data}
      </dd>
    </>
  );
}

function Choice({ choice }: { choice: NonNullable<Card["choice"]> }) {
  return (
    <div class="table-wrap">
      {choice.tallies.length > 1 && <p class="muted small">{text.triedHint}</p>}
      <table class="table">
        <thead>
          <tr>
            <th scope="col">{text.tried}</th>
            <th scope="col">{text.opinions}</th>
            <th scope="col" class="num">
              {text.right}
            </th>
          </tr>
        </thead>
        <tbody>
          {choice.tallies.map(({ name, opinions, n_right, n_frames }, index) => (
            <tr key={name} class={index === choice.chosen ? "chosen" : undefined}>
              <td>
                {name}
                {index === choice.chosen && <strong> · {text.chosen}</strong>}
              </td>
              <td>{opinions.join(", ")}</td>
              <td class="num">
                {percent(n_right / Math.max(n_frames, 1))}{" "}
                <span class="muted">{text.ofN(n_frames)}</span>
              </td>
            </tr>
          ))}
        </tbody>
      </table>
    </div>
  );
}
