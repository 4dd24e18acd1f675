import { route } from "../../route";
import { RecordPage } from "./record-page";
import { SetPage } from "./set-page";
import { SetsPage } from "./sets-page";
import "./teach.css";

export default function TeachPage() {
  const [set, part] = route.value.rest;
  if (set === undefined) return <SetsPage />;
  if (part === "record") return <RecordPage key={set} set={set} />;
  return <SetPage key={set} name={set} part={part} />;
}
