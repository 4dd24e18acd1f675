import { PageHead } from "../../components/layout";
import { text } from "../../texts/models";

export default function ModelsPage() {
  return <PageHead title={text.title} />;
}
