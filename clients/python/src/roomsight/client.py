"""The client for programs without ``asyncio``."""

from __future__ import annotations

import socket
import threading
from collections.abc import Iterator
from contextlib import ExitStack, suppress
from functools import partial
from ssl import SSLContext
from typing import Any, Optional, Union
from weakref import WeakSet, finalize

import httpx
from websockets.exceptions import WebSocketException
from websockets.sync.client import ClientConnection, connect
from websockets.typing import Subprotocol

from . import calls, lasting, messages
from .calls import DEFAULT_URL, PATIENCE_S, Frame
from .closing import Closing
from .errors import ConnectionLost, ResumePoint, RoomsightError
from .events import Event, read_event
from .inbox import Inbox
from .keys import Keys
from .lasting import LastingStream
from .messages import Hello, Message, Position
from .models import ModelCalls
from .robots import RobotCalls
from .senses import Beside, Odometry, Scan
from .service import ServiceCalls
from .sets import Sets
from .steps import Caller
from .trainings import Trainings


class Client(ModelCalls, RobotCalls, ServiceCalls, Caller, Closing):
    """A service that can be called, with a key where it asks for one. Close it, or use it with ``with``.

    At an ``https://``, ``ssl`` says whom to believe, such as ``ssl.create_default_context(cafile="ca.pem")``;
    left out, the authorities that the system believes.
    """

    def __init__(
        self, url: str = DEFAULT_URL, key: Optional[str] = None, *, ssl: Optional[SSLContext] = None
    ) -> None:
        self._url = calls.check_url(url)
        self._headers = calls.authorization(key)
        self._ssl = calls.tls(url, ssl)
        super().__init__(
            httpx.Client(
                base_url=self._url,
                headers=self._headers,
                timeout=PATIENCE_S,
                verify=True if self._ssl is None else self._ssl,
            )
        )
        self.sets = Sets(self._http)
        self.inbox = Inbox(self._http)
        self.trainings = Trainings(self._http)
        self.keys = Keys(self._http)
        self._events: WeakSet[Events] = WeakSet()

    def events(self, *, fleet: bool = False) -> Events:
        """What happens from now on; with ``fleet`` also, but for answers, at other services."""
        try:
            response = self._http.send(self._http.build_request(**calls.events_call(fleet)), stream=True)
            if not response.is_success:
                response.read()
        except httpx.HTTPError as error:
            raise calls.lost(error) from error
        calls.check_done(response)
        events = Events(response)
        self._events.add(events)
        return events

    def stream(
        self,
        *,
        robot: Optional[str] = None,
        model: Optional[str] = None,
        mode: Optional[str] = None,
        interval_ms: Optional[int] = None,
        sure_interval_ms: Optional[int] = None,
        filter: Union[bool, dict[str, float], None] = None,
        deadline_ms: Optional[int] = None,
        top: Optional[int] = None,
        explain: Optional[bool] = None,
    ) -> Stream:
        """Opens a stream. ``mode`` is ``latest``, ``lossless`` or ``sampled``; for the rest see ``configure``."""
        settings = {
            "robot": robot,
            "model": model,
            "mode": mode,
            "interval_ms": interval_ms,
            "sure_interval_ms": sure_interval_ms,
            "filter": filter,
            "deadline_ms": deadline_ms,
            "top": top,
            "explain": explain,
        }
        return self._begin(settings, None)

    def lasting_stream(self, *, patience_s: float = lasting.PATIENCE_S, **settings: Any) -> LastingStream:
        """Opens a stream, with the settings of ``stream``, that goes on by itself where its connection breaks or its service
        stops: on the same service or, where services share their ``resume_keys``, on another behind the same address.

        ``patience_s`` is how long the service may be out of reach.
        """
        return LastingStream(partial(self._begin, silence_s=lasting.SILENCE_S), settings, patience_s)

    def resume(self, point: ResumePoint) -> Stream:
        """Goes on with a stream whose connection broke; ``hello.resumed`` tells whether it could."""
        return self._open(messages.resume_query(point), point)

    def close(self) -> None:
        """Closes the connections of the calls and of the events. Streams are closed by themselves."""
        for events in list(self._events):
            events.close()
        self._http.close()

    def _begin(
        self, settings: dict[str, Any], point: Optional[ResumePoint], silence_s: Optional[float] = None
    ) -> Stream:
        stream = self._open(messages.begin_query(settings, point), point, silence_s)
        told = messages.not_in_address(settings)
        if told and not stream.hello.resumed:
            stream.configure(**told)
        return stream

    def _open(
        self, query: dict[str, Any], point: Optional[ResumePoint], silence_s: Optional[float] = None
    ) -> Stream:
        # What was opened is closed again where the stream does not begin as it should.
        with ExitStack() as opened:
            try:
                socket = opened.enter_context(
                    connect(
                        messages.stream_url(self._url, query),
                        subprotocols=[Subprotocol(messages.SUBPROTOCOL)],
                        additional_headers=self._headers,
                        # Images are compressed already.
                        compression=None,
                        open_timeout=PATIENCE_S,
                        # An answer to a ping waits behind our own frame on a slow link, or while the service holds
                        # us back, so that one that is late tells of no fault. The service asks by itself.
                        ping_timeout=silence_s,
                        ssl=self._ssl,
                    )
                )
                hello = calls.read_hello(socket.recv(PATIENCE_S))
            except (WebSocketException, OSError) as error:
                raise calls.lost(error) from error
            return Stream(socket, opened.pop_all(), Position(hello, point), hello)


class Events(Closing):
    """What happens, as it happens. Made by ``Client.events``.

    Ends where it, or its client, is closed, which another thread may do; with ``ConnectionLost`` where the service
    ends it.
    """

    def __init__(self, response: httpx.Response) -> None:
        self._response = response
        self._lines = response.iter_lines()
        self._reading = threading.RLock()
        self._is_closed = False
        # Whoever leaves the loop and forgets the events does not hold their connection.
        finalize(self, response.close)

    def __iter__(self) -> Events:
        return self

    def __next__(self) -> Event:
        with self._reading:
            try:
                for line in self._lines:
                    event = read_event(line)
                    if event is not None:
                        return event
            except (httpx.HTTPError, httpx.StreamError) as error:
                if not self._is_closed:
                    raise calls.lost(error) from error
        if self._is_closed:
            raise StopIteration
        raise ConnectionLost("the service ended the events")

    def close(self) -> None:
        """Ends the events, also for a thread that waits for the next."""
        self._is_closed = True
        # A thread that waits in the socket wakes up by nothing else.
        with suppress(OSError):
            self._response.extensions["network_stream"].get_extra_info("socket").shutdown(socket.SHUT_RDWR)
        with self._reading:
            self._response.close()


class Stream(Closing):
    """An open stream; every frame gets one answer, in the order sent. Made by ``Client.stream``.

    One thread may send while another receives.
    """

    def __init__(
        self, socket: ClientConnection, opened: ExitStack, position: Position, hello: Hello
    ) -> None:
        self.hello = hello
        self._socket = socket
        self._opened = opened
        self._position = position

    @property
    def point(self) -> ResumePoint:
        """Where ``Client.resume`` can go on."""
        return self._position.point

    def send(
        self,
        frame: Frame,
        *,
        captured_at_ns: Optional[int] = None,
        odometry: Optional[Odometry] = None,
        scan: Optional[Scan] = None,
    ) -> int:
        """Sends an encoded image, and returns its number.

        ``captured_at_ns`` is as of ``time.time_ns()``; ``odometry`` lets the filter take the way instead of the time; ``scan`` is what the
        laser measured beside it, for models that look at that.
        """
        beside = Beside(captured_at_ns, odometry, scan)
        # What cannot be sent takes no number.
        message = messages.frame_message(calls.frame_bytes(frame), self._position.next_seq, beside)
        seq = self._position.number()
        self._send(message)
        return seq

    def send_numbered(self, frame: bytes, seq: int, beside: Beside = Beside()) -> None:
        """Sends an encoded image under a number of your own, larger than those before it."""
        message = messages.numbered_message(frame, seq, beside)
        self._position.next_seq = seq + 1
        self._send(message)

    def configure(
        self,
        *,
        robot: Optional[str] = None,
        model: Optional[str] = None,
        mode: Optional[str] = None,
        interval_ms: Optional[int] = None,
        sure_interval_ms: Optional[int] = None,
        filter: Union[bool, dict[str, float], None] = None,
        deadline_ms: Optional[int] = None,
        top: Optional[int] = None,
        explain: Optional[bool] = None,
    ) -> None:
        """Changes the stream; what is left out stays. The service answers with ``Configured``.

        ``sure_interval_ms`` is the ``interval_ms`` of ``sampled`` while the room is known and stays the same;
        ``filter`` is True, False or ``{"trust": 0.5}``; ``deadline_ms`` is how long a frame may wait; ``explain``
        asks for the training frames that are most like each.
        """
        settings = {
            "robot": robot,
            "model": model,
            "mode": mode,
            "interval_ms": interval_ms,
            "sure_interval_ms": sure_interval_ms,
            "filter": filter,
            "deadline_ms": deadline_ms,
            "top": top,
            "explain": explain,
        }
        self._send(messages.configure_message(settings))

    def receive(self, timeout: Optional[float] = None) -> Message:
        """The next message. Raises ``TimeoutError`` after ``timeout`` seconds, ``ConnectionLost`` at the end."""
        try:
            return self._position.read(self._socket.recv(timeout))
        except WebSocketException as error:
            raise self._lost(error) from error

    def answer(self, timeout: Optional[float] = None) -> Union[messages.Result, messages.Dropped, messages.Error]:
        """The answer to the oldest frame that has none yet; other messages are passed over."""
        while True:
            message = self.receive(timeout)
            if isinstance(message, (messages.Result, messages.Dropped, messages.Error)):
                return message

    def __iter__(self) -> Iterator[Message]:
        """All messages; ends with ``ConnectionLost``."""
        while True:
            yield self.receive()

    def close(self) -> None:
        """Ends the stream."""
        self._opened.close()

    def _send(self, message: Union[str, bytes]) -> None:
        try:
            self._socket.send(message)
        except WebSocketException as error:
            raise self._lost(error) from error

    def _lost(self, error: Exception) -> RoomsightError:
        return calls.lost(error, self.point)
