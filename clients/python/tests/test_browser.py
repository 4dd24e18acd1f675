"""What a page in a real browser can do to a service without keys: nothing, unless it is the service's own or one of
the setting ``origins``. Left out where there is no Chromium."""

import json
import shutil
import socket
import subprocess
import sys
import tempfile
import threading
import time
import unittest
import urllib.request
from collections.abc import Iterator
from contextlib import contextmanager
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from typing import Any

from running import PATIENCE_S, RunningService
from websockets.sync.client import connect

CHROMIUM = shutil.which("chromium") or shutil.which("chromium-browser") or shutil.which("google-chrome")
#: A name of an attacker, who lets it point to this machine.
EVIL = "evil.test"

#: Tries everything that costs or changes something, and tells what a page is told of it: a status, "opaque" where it
#: may not look, or "failed".
ATTEMPTS = """
async (base) => {
  const told = {};
  const attempt = async (name, path, options) => {
    try {
      const answer = await fetch(base + path, options);
      told[name] = answer.type === 'opaque' ? 'opaque' : answer.status;
    } catch (error) { told[name] = 'failed'; }
  };
  const opened = (source) => new Promise((resolve) => {
    source.onopen = () => resolve('opened');
    source.onerror = () => resolve('failed');
  });
  const model = '/v1/models/simulated-lab', blind = { method: 'POST', mode: 'no-cors' };
  const frame = new Uint8Array(64);
  await attempt('read', '/v1/models', {});
  await attempt('blind read', '/metrics', { mode: 'no-cors' });
  await attempt('frame', '/v1/recognize', { method: 'POST', body: frame });
  await attempt('blind frame', '/v1/recognize', { ...blind, body: frame });
  await attempt('activate', model + '/versions/1/activate', blind);
  await attempt('rollback', model + '/rollback', blind);
  await attempt('load', '/v2/repository/models/simulated-lab/load', blind);
  await attempt('label', model + '/labels/shadow', { method: 'PUT', body: '{"version": 1}' });
  await attempt('upload', model + '/versions/9', { method: 'PUT', body: frame });
  await attempt('delete', model + '/versions/9', { method: 'DELETE' });
  const events = new EventSource(base + '/v1/events');
  told['events'] = await opened(events);
  events.close();
  const stream = new WebSocket(base.replace('http', 'ws') + '/v1/stream', ['roomsight.v1']);
  told['stream'] = await opened(stream);
  stream.close();
  return told;
}
"""

#: What a request was that has done nothing: refused, a question whether it may come, or one that tells nothing.
NOTHING = ['status="4', 'method="OPTIONS"', 'route="/livez"', 'route="/readyz"', 'route="/metrics"', 'route="(none)"']


class Page(BaseHTTPRequestHandler):
    """A page of another site."""

    def do_GET(self) -> None:
        self.send_response(200)
        self.send_header("Content-Type", "text/html")
        self.end_headers()
        self.wfile.write(b"<title>a page</title>")

    def log_message(self, *_: Any) -> None:
        pass


class Tab:
    """A page in the browser, over its debugging protocol."""

    def __init__(self, url: str) -> None:
        self._socket = connect(url, max_size=None, open_timeout=PATIENCE_S)
        self._number = 0
        self._say("Page.enable")

    def open(self, url: str) -> None:
        """Goes to an address, and waits until the page is there."""
        self._say("Page.navigate", url=url)
        while self._hear().get("method") != "Page.loadEventFired":
            pass

    def run(self, script: str) -> Any:
        """What a script comes to in the page."""
        answer = self._say("Runtime.evaluate", expression=script, awaitPromise=True, returnByValue=True)
        return answer["result"].get("value", answer)

    def close(self) -> None:
        """Lets go of the page."""
        self._socket.close()

    def _say(self, method: str, **params: Any) -> Any:
        self._number += 1
        self._socket.send(json.dumps({"id": self._number, "method": method, "params": params}))
        while (answer := self._hear()).get("id") != self._number:
            pass
        return answer["result"]

    def _hear(self) -> Any:
        return json.loads(self._socket.recv(PATIENCE_S))


@contextmanager
def browser() -> Iterator[Tab]:
    """A browser for which the attacker's name points to this machine."""
    assert CHROMIUM is not None
    with tempfile.TemporaryDirectory(ignore_cleanup_errors=True) as profile:
        switches = ["--headless=new", "--no-sandbox", "--disable-gpu", "--remote-debugging-port=0"]
        names = [f"--host-resolver-rules=MAP {EVIL} 127.0.0.1", f"--user-data-dir={profile}"]
        process = subprocess.Popen(
            [CHROMIUM, *switches, *names, "about:blank"], stdout=subprocess.DEVNULL, stderr=subprocess.DEVNULL
        )
        try:
            told, started = Path(profile) / "DevToolsActivePort", time.monotonic()
            while not (told.exists() and told.read_text().strip()):
                if time.monotonic() - started > PATIENCE_S:
                    raise AssertionError("the browser did not start")
                time.sleep(0.05)
            debugger = f"http://127.0.0.1:{told.read_text().split()[0]}/json/new?about:blank"
            request = urllib.request.Request(debugger, method="PUT")
            with urllib.request.urlopen(request) as answer:
                tab = Tab(json.load(answer)["webSocketDebuggerUrl"])
            yield tab
            tab.close()
        finally:
            process.terminate()
            process.wait()


def free_port() -> int:
    """A port that nobody listens on."""
    with socket.socket() as free:
        free.bind(("127.0.0.1", 0))
        return int(free.getsockname()[1])


class Browser(RunningService):
    """Pages against one service without keys."""

    port = free_port()
    settings = [f"origins=http://localhost:{port}"]

    @classmethod
    def setUpClass(cls) -> None:
        if CHROMIUM is None:
            print("LEFT OUT: the tests of pages in a browser. They take chromium.", file=sys.stderr)
            raise unittest.SkipTest("there is no Chromium")
        super().setUpClass()
        pages = ThreadingHTTPServer(("127.0.0.1", cls.port), Page)
        threading.Thread(target=pages.serve_forever, daemon=True).start()
        cls.addClassCleanup(pages.shutdown)

    def carried_out(self) -> "dict[str, float]":
        """How often each call that takes a key where there are keys was carried out."""
        with urllib.request.urlopen(f"{self.url}/metrics") as answer:
            lines = answer.read().decode().splitlines()
        counts = {}
        for line in lines:
            if line.startswith("roomsight_requests_total{") and not any(word in line for word in NOTHING):
                labels, count = line.rsplit(" ", 1)
                counts[labels] = float(count)
        return counts

    def test_pages_of_others_can_do_nothing(self) -> None:
        evil_service = self.url.replace("127.0.0.1", EVIL)
        blank = Path(self.folder.name) / "page.html"
        blank.write_text("<title>a page</title>")
        hostile = {
            "another port": (f"http://127.0.0.1:{self.port}/", self.url),
            "another site": (f"http://{EVIL}:{self.port}/", self.url),
            "a file": (blank.as_uri(), self.url),
            "a name that points here": (f"{evil_service}/livez", evil_service),
        }
        with browser() as tab:
            for page, (address, service) in hostile.items():
                with self.subTest(page):
                    before = self.carried_out()
                    tab.open(address)
                    told = tab.run(f"({ATTEMPTS})('{service}')")
                    allowed = {"failed", "opaque", 403, 404, 405}
                    self.assertEqual({name for name, what in told.items() if what not in allowed}, set(), told)
                    self.assertEqual(self.carried_out(), before)

    def test_the_services_own_page_and_those_that_were_set_may_call(self) -> None:
        own = {"its own": f"{self.url}/livez", "one of `origins`": f"http://localhost:{self.port}/"}
        with browser() as tab:
            for page, address in own.items():
                with self.subTest(page):
                    tab.open(address)
                    told = tab.run(f"({ATTEMPTS})('{self.url}')")
                    expected = {"read": 200, "frame": 422, "label": 409, "events": "opened", "stream": "opened"}
                    self.assertEqual({name: told[name] for name in expected}, expected, told)
