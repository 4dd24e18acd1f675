import { PageHead } from "../../components/layout";
import { text } from "../../texts/live";

export default function LivePage() {
  return <PageHead title={text.title} />;
}
