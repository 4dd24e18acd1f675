import { PageHead } from "../../components/layout";
import { text } from "../../texts/inbox";

export default function InboxPage() {
  return <PageHead title={text.title} />;
}
