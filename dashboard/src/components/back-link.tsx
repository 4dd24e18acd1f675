import { Icon } from "./icons";

/** The way back, before the title of a page. */
export function BackLink({ href, label }: { href: string; label: string }) {
  return (
    <a class="back" href={href}>
      <Icon name="back" size={16} />
      {label}
    </a>
  );
}
