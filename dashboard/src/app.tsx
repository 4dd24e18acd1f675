import { useEffect, useErrorBoundary, useRef, useState } from "preact/hooks";
import { messageOf } from "./api/client";
import { signInWithCode } from "./api/session";
import { Button } from "./components/button";
import { Confirmations } from "./components/dialog";
import { Icon } from "./components/icons";
import { Busy, ErrorNote } from "./components/layout";
import { lazy } from "./components/lazy";
import { toastError } from "./components/toast";
import { Toasts } from "./components/toasts";
import sign from "./favicon.svg";
import { Corrections } from "./components/wrong";
import { duration } from "./format";
import { inboxOpen, useInboxCount } from "./inbox-count";
import LivePage from "./pages/live";
import { go, href, type Page, PAGES, route, type PageProps } from "./route";
import { checkSession, session, signedIn, signOut } from "./session";
import { SignIn } from "./sign-in";
import { text } from "./texts/common";

const COMPONENTS = {
  live: LivePage,
  try: lazy<PageProps>(() => import("./pages/try")),
  teach: lazy<PageProps>(() => import("./pages/teach")),
  inbox: lazy<PageProps>(() => import("./pages/inbox")),
  models: lazy<PageProps>(() => import("./pages/models")),
  service: lazy<PageProps>(() => import("./pages/service")),
};

export function App() {
  const [codeFailed, setCodeFailed] = useState(false);
  useEffect(() => {
    const { page, rest } = route.value;
    if (page !== "code") {
      void checkSession();
      return;
    }
    // The code is used once: it does not stay in the address.
    signInWithCode(rest[0] ?? "").then(
      (info) => {
        go(href("try"), true);
        signedIn(info);
      },
      () => {
        go(href("try"), true);
        setCodeFailed(true);
        void checkSession();
      },
    );
  }, []);

  const state = session.value;
  const main = useRef<HTMLElement>(null);
  const { page, rest } = route.value;
  const shown = state.kind === "in" || (state.kind === "out" && state.before);
  const skip = (event: Event) => {
    event.preventDefault();
    main.current?.focus();
  };
  return (
    <div class="app">
      <a class="skip" href="#main" onClick={skip}>
        {text.skip}
      </a>
      <header class="side">
        <a class="brand" href={href("live")}>
          <img src={sign} alt="" />
          {text.product}
        </a>
        <Navigation current={page} />
        <Who />
      </header>
      <main class="main" id="main" ref={main} tabIndex={-1}>
        {state.kind === "checking" && <Busy />}
        {state.kind === "failed" && (
          <ErrorNote error={state.error} onRetry={() => void checkSession()} />
        )}
        {shown && page !== "code" && <Shown key={page} page={page} rest={rest} />}
        {state.kind === "out" && <SignIn before={state.before} codeFailed={codeFailed} />}
      </main>
      <Corrections />
      <Confirmations />
      <Toasts />
    </div>
  );
}

function Shown({ page, rest }: { page: Page; rest: string[] }) {
  const [failure, reset] = useErrorBoundary() as [unknown, () => void];
  if (failure !== undefined) {
    return <ErrorNote error={`${text.partFailed} ${messageOf(failure)}`} onRetry={reset} />;
  }
  const Component = COMPONENTS[page];
  return <Component rest={rest} />;
}

function Navigation({ current }: { current: string }) {
  useInboxCount();
  return (
    <nav class="nav" aria-label={text.pages}>
      <ul>
        {PAGES.map((page) => (
          <li key={page}>
            <a href={href(page)} aria-current={page === current ? "page" : undefined}>
              <Icon name={page} size={20} />
              {text[page]}
              {page === "inbox" && inboxOpen.value > 0 && (
                <span class="badge accent count">{inboxOpen.value}</span>
              )}
            </a>
          </li>
        ))}
      </ul>
    </nav>
  );
}

function Who() {
  const state = session.value;
  if (state.kind !== "in") return <div class="who" />;
  const { name, role, expires_in_s } = state.info;
  if (!role) {
    return (
      <div class="who">
        <span class="muted wide-only">{text.openService}</span>
      </div>
    );
  }
  return (
    <div class="who">
      <span class="muted clip" title={text.expiresIn(duration(expires_in_s))}>
        {text.signedInAs(name ?? "", role)}
      </span>
      <Button compact onClick={() => void signOut().catch(toastError)}>
        {text.signOut}
      </Button>
    </div>
  );
}
