import { useRef, useState } from "preact/hooks";
import { type KeyInfo, listKeys, type MadeKey, makeKey, revokeKey } from "../../api/keys";
import type { Role } from "../../api/session";
import { Button } from "../../components/button";
import { confirm, Dialog } from "../../components/dialog";
import { SelectField, TextField } from "../../components/fields";
import { Busy, EmptyState, ErrorNote, Note } from "../../components/layout";
import { Table } from "../../components/table";
import { toast, toastError } from "../../components/toast";
import { dateTime } from "../../format";
import { useAction, useLoad } from "../../hooks";
import { blockedFor, blockedForData, checkSession, service } from "../../session";
import { text as common } from "../../texts/common";
import { text } from "../../texts/service";

/** The keys of the service: who is let in, and as what. */
export function Keys() {
  const blocked = blockedFor("admin");
  if (blocked) return <EmptyState icon="key" title={text.keysRefused} text={blocked} />;
  const keptNowhere = blockedForData("admin");
  if (keptNowhere) return <EmptyState icon="key" title={text.keysNotHere} text={keptNowhere} />;
  return <KeyList />;
}

function KeyList() {
  const keys = useLoad(listKeys, []);
  const [making, setMaking] = useState(false);
  const [made, setMade] = useState<MadeKey>();
  const isOpen = service.value?.keys === false;
  const revoke = async ({ name }: KeyInfo) => {
    const question = {
      title: text.revokeTitle(name),
      text: text.revokeText,
      action: text.revoke,
      danger: true,
    };
    if (!(await confirm(question))) return;
    await revokeKey(name);
    toast({ text: text.revoked(name) });
    keys.reload();
  };
  return (
    <div class="stack">
      <div class="row">
        <p class="muted grow">{text.keysLead}</p>
        <Button kind="primary" icon="add" onClick={() => setMaking(true)}>
          {isOpen ? text.makeFirstKey : text.makeKey}
        </Button>
      </div>
      {isOpen && (
        <Note kind="warn">
          <p>{text.keysOpen}</p>
        </Note>
      )}
      {keys.error !== undefined && <ErrorNote error={keys.error} onRetry={keys.reload} />}
      {!keys.data && keys.loading && <Busy />}
      {keys.data?.length === 0 && <EmptyState icon="key" title={text.keysNone} />}
      {keys.data && keys.data.length > 0 && (
        <div class="card padded">
          <Table
            label={text.keys}
            head={[text.keyName, text.role, text.keyRobots, text.made, text.revoke]}
            rows={keys.data.map((key) => ({
              key: key.name,
              cells: [
                <strong>{key.name}</strong>,
                key.role,
                key.robots.join(", ") || text.anyRobot,
                key.from === "settings" ? text.inSettings : dateTime(key.made_at),
                <Button
                  compact
                  kind="danger"
                  blocked={key.from === "settings" ? text.fromSettings : undefined}
                  onClick={() => void revoke(key).catch(toastError)}
                >
                  {text.revoke}
                </Button>,
              ],
            }))}
          />
        </div>
      )}
      {making && (
        <MakeKey
          isFirst={isOpen}
          onClose={() => setMaking(false)}
          onMade={(key) => {
            setMaking(false);
            setMade(key);
          }}
        />
      )}
      {made && (
        <ToldKey
          made={made}
          onClose={() => {
            setMade(undefined);
            keys.reload();
            // With the first key this page has become signed in.
            if (isOpen) void checkSession();
          }}
        />
      )}
    </div>
  );
}

const ROLES: Role[] = ["robot", "viewer", "admin"];

function MakeKey(props: { isFirst: boolean; onClose: () => void; onMade: (key: MadeKey) => void }) {
  const [name, setName] = useState("");
  const [role, setRole] = useState<Role>(props.isFirst ? "admin" : "robot");
  const [robots, setRobots] = useState("");
  const [wrong, setWrong] = useState<string>();
  const { run, busy, error } = useAction(async () => {
    setWrong(name.trim() ? undefined : text.keyNameMissing);
    if (!name.trim()) return;
    const bound = robots
      .split(",")
      .map((robot) => robot.trim())
      .filter(Boolean);
    const isBound = role === "robot" && bound.length > 0;
    props.onMade(await makeKey({ name: name.trim(), role, robots: isBound ? bound : undefined }));
  });
  const roles = props.isFirst ? ROLES.filter((one) => one === "admin") : ROLES;
  return (
    <Dialog title={props.isFirst ? text.makeFirstKey : text.makeKey} onClose={props.onClose}>
      {error !== undefined && <ErrorNote error={error} />}
      <form
        class="stack"
        onSubmit={(event) => {
          event.preventDefault();
          void run();
        }}
      >
        <TextField
          label={text.keyName}
          hint={text.keyNameHint}
          wrong={wrong}
          value={name}
          onInput={setName}
          maxLength={64}
          autoFocus
        />
        <SelectField
          label={text.role}
          value={role}
          options={roles.map((value) => ({ value, label: text.roles[value] }))}
          onChange={(value) => setRole(value as Role)}
        />
        {role === "robot" && (
          <TextField
            label={text.keyRobots}
            hint={text.keyRobotsHint}
            value={robots}
            onInput={setRobots}
          />
        )}
        <div class="dialog-foot">
          <Button onClick={props.onClose}>{common.cancel}</Button>
          <Button kind="primary" type="submit" busy={busy}>
            {text.makeKey}
          </Button>
        </div>
      </form>
    </Dialog>
  );
}

function ToldKey({ made, onClose }: { made: MadeKey; onClose: () => void }) {
  const field = useRef<HTMLInputElement>(null);
  const copy = async () => {
    field.current?.select();
    try {
      await navigator.clipboard.writeText(made.key);
      toast({ text: text.copied });
    } catch {
      toast({ text: text.copyFailed, kind: "bad" });
    }
  };
  return (
    <Dialog title={text.told} onClose={onClose} closable={false}>
      <p>{text.toldLead(made.name)}</p>
      <div class="row told-key">
        <input
          ref={field}
          class="input grow"
          readOnly
          value={made.key}
          aria-label={text.told}
          onFocus={(event) => event.currentTarget.select()}
        />
        <Button icon="copy" onClick={() => void copy()}>
          {text.copy}
        </Button>
      </div>
      <div class="dialog-foot">
        <Button kind="primary" onClick={onClose}>
          {text.toldDone}
        </Button>
      </div>
    </Dialog>
  );
}
