import { PageHead } from "../../components/layout";
import { text } from "../../texts/try";

export default function TryPage() {
  return <PageHead title={text.title} />;
}
