import { PageHead } from "../../components/layout";
import { text } from "../../texts/teach";

export default function TeachPage() {
  return <PageHead title={text.title} />;
}
