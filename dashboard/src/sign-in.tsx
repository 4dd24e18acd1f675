import { useState } from "preact/hooks";
import { ApiError } from "./api/client";
import { signIn } from "./api/session";
import { Button } from "./components/button";
import { Dialog } from "./components/dialog";
import { TextField } from "./components/fields";
import { ErrorNote } from "./components/layout";
import { useAction } from "./hooks";
import { signedIn } from "./session";
import { text } from "./texts/common";

/** Asks for a key; what was open before stays in place behind it. */
export function SignIn({ before, codeFailed }: { before: boolean; codeFailed: boolean }) {
  const [key, setKey] = useState("");
  const [wrong, setWrong] = useState<string>();
  const { run, busy, error } = useAction(async () => {
    const sent = key.trim();
    setWrong(sent ? undefined : text.keyMissing);
    if (!sent) return;
    try {
      signedIn(await signIn(sent));
    } catch (refusal) {
      if (!(refusal instanceof ApiError && refusal.status === 401)) throw refusal;
      setWrong(refusal.message);
    }
  });
  const submit = (event: SubmitEvent) => {
    event.preventDefault();
    void run();
  };
  return (
    <Dialog title={text.signInTitle} onClose={() => undefined} closable={false}>
      <p class="muted">{before ? text.signInAgain : text.signInLead}</p>
      {codeFailed && <ErrorNote error={text.codeFailed} />}
      {error !== undefined && <ErrorNote error={error} />}
      <form class="stack" onSubmit={submit}>
        <TextField
          label={text.key}
          hint={text.keyHint}
          wrong={wrong}
          type="password"
          value={key}
          onInput={setKey}
          autoComplete="current-password"
          autoFocus
        />
        <div class="dialog-foot">
          <Button kind="primary" type="submit" busy={busy}>
            {busy ? text.signingIn : text.signIn}
          </Button>
        </div>
      </form>
    </Dialog>
  );
}
