import { useState } from "preact/hooks";
import { PageHead } from "../../components/layout";
import { NoModel, useNoModel } from "../../components/no-model";
import { Tabs } from "../../components/tabs";
import { text } from "../../texts/try";
import { CameraSource } from "./camera-source";
import { PictureSource } from "./picture-source";
import "./try.css";

type Source = "picture" | "camera";

const SOURCES: { id: Source; label: string }[] = [
  { id: "picture", label: text.picture },
  { id: "camera", label: text.camera },
];

/** Phones come here to point their camera. */
const isHandheld = matchMedia("(pointer: coarse)").matches;

export default function TryPage() {
  const [source, setSource] = useState<Source>(isHandheld ? "camera" : "picture");
  const hasNoModel = useNoModel();
  return (
    <>
      <PageHead title={text.title} lead={text.lead} />
      {hasNoModel ? (
        <NoModel />
      ) : (
        <Tabs label={text.sources} tabs={SOURCES} chosen={source} onChoose={setSource}>
          <div class="try-panel">{source === "camera" ? <CameraSource /> : <PictureSource />}</div>
        </Tabs>
      )}
    </>
  );
}
