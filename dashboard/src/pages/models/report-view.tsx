import { decimal, percent } from "../../format";
import { text } from "../../texts/models";
import { About } from "./about";
import { ByRoom } from "./by-room";
import { Confusion } from "./confusion";
import { Difference } from "./difference";
import { Reliability } from "./reliability";
import type { Described } from "./subject";
import type { Rate } from "../../api/trainings";

/** What is known of one model, or of two side by side. */
export function ReportView({ described }: { described: Described[] }) {
  const reports = described.map(({ report }) => report);
  const hasReports = reports.some((report) => report !== undefined);
  const columns = described.length === 1 ? "" : "two";
  return (
    <div class="report stack">
      {hasReports && (
        <section class="card padded">
          <h2>{text.figures}</h2>
          <Figures described={described} />
        </section>
      )}
      {hasReports && (
        <div class="report-grid">
          <section class="card padded">
            <h2>{text.byRoom}</h2>
            <ByRoom described={described} />
          </section>
          <section class="card padded">
            <h2>{text.reliability}</h2>
            <p class="muted small measure">{text.reliabilityLead}</p>
            <Reliability described={described} />
          </section>
        </div>
      )}
      {hasReports && (
        <section class="card padded">
          <h2>{text.confusion}</h2>
          <p class="muted small measure">{text.confusionLead}</p>
          <div class={`side-by-side ${columns}`}>
            {described.map(
              ({ label, report }) =>
                report && <Confusion key={label} label={label} evaluation={report.held_out} />,
            )}
          </div>
        </section>
      )}
      <section class="card padded">
        <h2>{text.about}</h2>
        <div class={`side-by-side ${columns}`}>
          {described.map((one) => (
            <About key={one.label} described={one} hasLabel={described.length > 1} />
          ))}
        </div>
      </section>
    </div>
  );
}

interface Figure {
  label: string;
  values: (Rate | undefined)[];
}

/** A share without a count behind it. */
const bare = (rate: number | null | undefined): Rate | undefined =>
  rate == null ? undefined : { rate, n_correct: 0, n_frames: 0 };

function Figures({ described }: { described: Described[] }) {
  const reports = described.map(({ report }) => report);
  const figures: Figure[] = [
    { label: text.overall, values: reports.map((report) => report?.held_out.overall) },
    {
      label: text.meanByRoom,
      values: reports.map((report) => bare(report?.held_out.mean_by_place)),
    },
    {
      label: text.coverage,
      values: reports.map((report) => report?.verdict.knowledge.right_known),
    },
    { label: text.precision, values: reports.map((report) => report?.verdict.knowledge.known) },
    {
      label: text.newUnknown,
      values: reports.map((report) => report?.verdict.knowledge.new_unknown),
    },
  ];
  const errors = reports.map((report) => report?.verdict.knowledge.calibration_error);
  return (
    <div class="table-wrap">
      <table class="table figures">
        <thead>
          <tr>
            <th scope="col">{text.figure}</th>
            {described.map(({ label }) => (
              <th key={label} scope="col" class="num">
                {label}
              </th>
            ))}
            {described.length > 1 && (
              <th scope="col" class="num">
                {text.difference}
              </th>
            )}
          </tr>
        </thead>
        <tbody>
          {figures.map(({ label, values }) => (
            <tr key={label}>
              <th scope="row">{label}</th>
              {values.map((value, index) => (
                <td key={index} class="num">
                  <FigureValue value={value} />
                </td>
              ))}
              {values.length > 1 && (
                <td class="num">
                  <Difference before={values[0]} now={values[1]} />
                </td>
              )}
            </tr>
          ))}
          <tr>
            <th scope="row">{text.calibration}</th>
            {errors.map((error, index) => (
              <td key={index} class="num">
                {decimal(error, 3)}
              </td>
            ))}
            {errors.length > 1 && <td />}
          </tr>
        </tbody>
      </table>
    </div>
  );
}

function FigureValue({ value }: { value: Rate | undefined }) {
  return (
    <>
      <strong>{percent(value?.rate)}</strong>
      {value && value.n_frames > 0 && <span class="muted"> {text.ofN(value.n_frames)}</span>}
    </>
  );
}
