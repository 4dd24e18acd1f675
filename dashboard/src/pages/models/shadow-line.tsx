import type { ShadowInfo } from "../../api/models";
import { Progress } from "../../components/bars";
import { decimal, percent } from "../../format";
import { href } from "../../route";
import { text } from "../../texts/models";

/** How often a shadow agrees with what serves. */
export function ShadowLine({ shadow }: { shadow: ShadowInfo }) {
  const { compared, agreed, skipped, mean_distance: distance } = shadow;
  if (compared === 0) return <p class="muted small">{text.agreesNothing}</p>;
  const share = agreed / compared;
  const more = [
    text.agreed(percent(share), compared),
    distance != null && text.distance(decimal(distance, 2)),
    skipped > 0 && text.skipped(skipped),
  ];
  return (
    <div class="shadow-line">
      <Progress label={text.agreement} value={share} />
      <p class="small">
        {text.agreement}: {more.filter(Boolean).join(" · ")}{" "}
        <a href={href("inbox", "frames", "shadow_apart")}>{text.disagreements}</a>
      </p>
    </div>
  );
}
