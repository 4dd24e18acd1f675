import { REASONS, type InboxFrame, type InboxQuery, type Reason } from "../../api/inbox";
import { CompactSelect } from "../../components/fields";
import { route } from "../../route";
import { text } from "../../texts/inbox";

const STATES = ["open", "labeled", "all"] as const;
const SORTS = ["value", "newest"] as const;

/** What the address asks for: `#/inbox/frames/shadow_apart` shows frames of one reason. */
export function fromRoute(): InboxQuery {
  const [, asked] = route.value.rest;
  return { state: "open", sort: "value", reason: REASONS.find((reason) => reason === asked) };
}

interface FiltersProps {
  query: InboxQuery;
  /** Frames that are there: of their robots and rooms one is chosen. */
  frames: readonly InboxFrame[];
  onChange: (query: InboxQuery) => void;
}

export function Filters({ query, frames, onChange }: FiltersProps) {
  const any = (label: string) => ({ value: "", label });
  const named = (names: (string | undefined)[], chosen: string | undefined) =>
    [...new Set([...names, chosen])]
      .filter((name) => name !== undefined)
      .sort()
      .map((name) => ({ value: name, label: name }));
  const robots = frames.map(({ robot }) => robot);
  const rooms = frames.map(({ room }) => room);
  return (
    <div class="row" role="group" aria-label={text.filters}>
      <CompactSelect
        label={text.state}
        value={query.state}
        options={STATES.map((value) => ({ value, label: text.states[value] }))}
        onChange={(state) => onChange({ ...query, state: state as InboxQuery["state"] })}
      />
      <CompactSelect
        label={text.reason}
        value={query.reason ?? ""}
        options={[
          any(text.anyReason),
          ...REASONS.map((value) => ({ value, label: text.reasons[value] })),
        ]}
        onChange={(reason) => onChange({ ...query, reason: (reason || undefined) as Reason })}
      />
      <CompactSelect
        label={text.robot}
        value={query.robot ?? ""}
        options={[any(text.anyRobot), ...named(robots, query.robot)]}
        onChange={(robot) => onChange({ ...query, robot: robot || undefined })}
      />
      <CompactSelect
        label={text.room}
        value={query.room ?? ""}
        options={[any(text.anyRoom), ...named(rooms, query.room)]}
        onChange={(room) => onChange({ ...query, room: room || undefined })}
      />
      <CompactSelect
        label={text.sort}
        value={query.sort}
        options={SORTS.map((value) => ({ value, label: text.sorts[value] }))}
        onChange={(sort) => onChange({ ...query, sort: sort as InboxQuery["sort"] })}
      />
    </div>
  );
}
