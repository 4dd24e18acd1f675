import type { Report } from "../../api/trainings";
import { percent } from "../../format";
import { text } from "../../texts/models";

/** What held-out frames say of a model, in sentences. */
export function VerdictView({ report }: { report: Report }) {
  const { verdict, not_held_out: notHeldOut } = report;
  const { knowledge, learning_curve: curve, confused } = verdict;
  const weak = verdict.weak_rooms.map(({ room, rate, n_more: more }) =>
    more === undefined
      ? text.verdictWeakRoom(room, percent(rate))
      : text.verdictWeakRoomMore(room, percent(rate), more),
  );
  const pairs = confused.map(({ shown, answered, n_frames }) =>
    text.verdictPair(shown, answered, n_frames),
  );
  const isRising = curve !== undefined && curve.rate_of_all - curve.rate_of_half > 0.01;
  return (
    <ul class="verdict-lines">
      {verdict.is_better_than_guessing === false && (
        <li class="worse">{text.verdictGuessing(percent(verdict.guessing))}</li>
      )}
      {/* First: the numbers after it are of frames much like those that trained. */}
      {verdict.rooms_of_one_drive.length > 0 && (
        <li>{text.verdictOneDrive(verdict.rooms_of_one_drive.join(", "))}</li>
      )}
      <li>
        {verdict.knows
          ? text.verdictKnows(percent(knowledge.right_known.rate), percent(knowledge.known.rate))
          : text.verdictKnowsNothing}
      </li>
      {curve && (
        <li>
          {(isRising ? text.verdictCurveRising : text.verdictCurveFlat)(
            percent(curve.rate_of_half),
            percent(curve.rate_of_all),
          )}
        </li>
      )}
      {pairs.length > 0 && <li>{text.verdictConfused(pairs.join(", "))}</li>}
      {weak.length > 0 && <li>{text.verdictWeak(weak.join(", "))}</li>}
      {notHeldOut.map(({ reason, n_frames, rooms }) => (
        <li key={reason} class="muted">
          {text.notHeldOut(n_frames, reason, rooms.join(", "))}
        </li>
      ))}
    </ul>
  );
}
