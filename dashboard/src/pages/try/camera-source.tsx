import { useEffect, useState } from "preact/hooks";
import type { NearestFrame } from "../../api/recognize";
import { cameraMissing, useCamera } from "../../camera";
import { Button } from "../../components/button";
import { chosenOf, EvidenceLegend, EvidenceOverlay } from "../../components/explained";
import { CheckField, CompactSelect } from "../../components/fields";
import { Icon } from "../../components/icons";
import { Busy, Note } from "../../components/layout";
import { Spoken } from "../../components/spoken";
import { decimal, milliseconds } from "../../format";
import { blockedFor } from "../../session";
import { text as common } from "../../texts/common";
import { text } from "../../texts/try";
import { AnswerView, Reasons } from "./answer-view";
import { type Seen, useStream } from "./use-stream";

/** The name under which this browser's camera is seen on Live, the same while its tab is open. */
const CAMERA_NAME = `camera-${Math.floor(Math.random() * 0xffff)
  .toString(16)
  .padStart(4, "0")}`;

/** What the camera sees, answered as it goes. */
export function CameraSource() {
  const camera = useCamera();
  const [explain, setExplain] = useState(false);
  const [chosen, setChosen] = useState<string>();
  const streaming = useStream(camera.running, camera.grab, CAMERA_NAME, explain);
  const { seen } = streaming;
  const shared = chosenOf(seen?.result, chosen);
  const missing = cameraMissing();
  if (missing) {
    return (
      <Note kind="warn">
        <p>{missing}</p>
      </Note>
    );
  }
  return (
    <div class="try-panes">
      <div class="card padded stack">
        <div class={`explained camera ${camera.running ? "" : "off"}`}>
          {/* Muted and inline: phones play it at once, in its place. */}
          <video ref={camera.video} muted playsInline aria-label={text.cameraLabel} />
          {camera.running && seen?.result.evidence && <Overlay seen={seen} shared={shared} />}
          {!camera.running && (
            <div class="camera-start">
              <Icon name="camera" size={48} />
              <Button
                kind="primary"
                blocked={blockedFor("robot")}
                onClick={() => void camera.start()}
              >
                {text.start}
              </Button>
              <p class="muted small">{text.startMore}</p>
            </div>
          )}
        </div>
        {camera.problem && (
          <Note kind="warn">
            <p>{camera.problem}</p>
          </Note>
        )}
        {camera.running && (
          <div class="row">
            <Button onClick={camera.stop}>{text.stop}</Button>
            {camera.devices.length > 1 && (
              <CompactSelect
                label={common.cameraChoose}
                value={camera.device ?? ""}
                options={camera.devices.map(({ id, label }) => ({ value: id, label }))}
                onChange={(id) => void camera.start(id)}
              />
            )}
            <CheckField label={text.explain} checked={explain} onChange={setExplain} />
            <span class="grow" />
            {explain && <EvidenceLegend shared={shared !== undefined} />}
          </div>
        )}
      </div>
      <div class="stack">
        {streaming.problem && (
          <Note kind="bad">
            <p>{streaming.problem}</p>
          </Note>
        )}
        {camera.running && streaming.state !== "open" && (
          <Busy label={streaming.state === "broken" ? text.lostConnection : text.connecting} />
        )}
        {seen && (
          <AnswerView
            answer={seen.result}
            filtered={seen.result.filtered}
            frame={seen.frame}
            robot={CAMERA_NAME}
          >
            {camera.running && (
              <p class="muted small number">
                {text.rate(decimal(seen.perSecond))} ·{" "}
                {text.roundTrip(milliseconds(seen.roundTripMs))} · {text.asRobot(CAMERA_NAME)}
              </p>
            )}
          </AnswerView>
        )}
        {seen && <Spoken text={inWords(seen)} />}
        {explain && seen?.result.nearest && (
          <Reasons answer={seen.result} chosen={chosen} onChoose={setChosen} />
        )}
      </div>
    </div>
  );
}

function inWords({ result }: Seen): string {
  const { room, known } = result.filtered ?? result;
  return text.said(room, known ? common.known : common.notKnown);
}

/** What spoke for the last answer, over the moving picture. */
function Overlay({ seen, shared }: { seen: Seen; shared?: NearestFrame }) {
  const [size, setSize] = useState<{ width: number; height: number }>();
  useEffect(() => {
    let wanted = true;
    void createImageBitmap(seen.frame).then((bitmap) => {
      const { width, height } = bitmap;
      bitmap.close();
      if (wanted) {
        setSize((before) =>
          before?.width === width && before.height === height ? before : { width, height },
        );
      }
    });
    return () => {
      wanted = false;
    };
  }, [seen.frame]);
  return size ? <EvidenceOverlay answer={seen.result} size={size} shared={shared} /> : null;
}
