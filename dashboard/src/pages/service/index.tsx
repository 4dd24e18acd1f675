import { PageHead } from "../../components/layout";
import { text } from "../../texts/service";

export default function ServicePage() {
  return <PageHead title={text.title} />;
}
