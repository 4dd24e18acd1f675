import { CAMERAS, EFFORTS, type Camera, type Effort } from "../api/trainings";
import { text } from "../texts/teach";
import { SelectField } from "./fields";

interface TrainingFieldsProps {
  effort: Effort;
  camera?: Camera;
  onChange: (part: { effort?: Effort; camera?: Camera }) => void;
}

/** How a training is done, whoever begins it. */
export function TrainingFields({ effort, camera, onChange }: TrainingFieldsProps) {
  return (
    <>
      <SelectField
        label={text.trainEffort}
        value={effort}
        options={EFFORTS.map((value) => ({ value, label: text.trainEfforts[value] }))}
        onChange={(value) => onChange({ effort: value as Effort })}
      />
      <SelectField
        label={text.trainCamera}
        value={camera ?? ""}
        options={["" as const, ...CAMERAS].map((value) => ({
          value,
          label: text.trainCameras[value],
        }))}
        onChange={(value) => onChange({ camera: (value || undefined) as Camera | undefined })}
      />
    </>
  );
}
