"""Streams that go on by themselves, over broken connections and services that stop."""

from __future__ import annotations

import asyncio
import random
import threading
import time
from collections import deque
from collections.abc import AsyncIterator, Awaitable, Iterator
from typing import TYPE_CHECKING, Any, Callable, Generic, Optional, TypeVar, Union

from . import calls
from .calls import Frame
from .closing import AsyncClosing, Closing
from .errors import ConnectionLost, ProtocolError, Refused, ResumePoint, RoomsightError
from .messages import Dropped, Error, Hello, Message, Result
from .senses import Beside, Odometry, Scan

if TYPE_CHECKING:
    from .aio import AsyncStream
    from .client import Stream

_Stream = TypeVar("_Stream", bound="Union[Stream, AsyncStream]")

#: How long a service may be out of reach by default, in seconds.
PATIENCE_S = 60.0
#: A stream over which no answer to a ping comes for so long, in seconds, has broken: its service hangs, or the network is gone.
SILENCE_S = 15.0
#: The longest wait before the second try, and ever, in seconds; it doubles from try to try.
_FIRST_WAIT_S, _LONGEST_WAIT_S = 0.1, 5.0
#: Codes with which a stream is closed that may go on elsewhere, or later: the service stops, restarts, or is full.
_PASSING_CODES = (None, 1001, 1005, 1006, 1011, 1012, 1013)
#: A service that has no room, or stops.
_PASSING_STATUSES = (429, 503)


def may_pass(error: RoomsightError) -> bool:
    """Whether it is worth another try."""
    if isinstance(error, ConnectionLost):
        return error.code in _PASSING_CODES
    if isinstance(error, Refused):
        return error.problem.status in _PASSING_STATUSES
    # A proxy whose services are gone says so in its own way.
    return isinstance(error, ProtocolError)


def waits(patience_s: float) -> Iterator[float]:
    """Random waits, in seconds, so that robots do not come back all at once; together as long as ``patience_s`` at most."""
    end, longest = time.monotonic() + patience_s, _FIRST_WAIT_S
    while True:
        wait_s = random.uniform(0.0, longest)
        if time.monotonic() + wait_s > end:
            return
        yield wait_s
        longest = min(2.0 * longest, _LONGEST_WAIT_S)


class Endings:
    """Which frames have no answer yet, and which of these no service knows."""

    def __init__(self, hello: Hello) -> None:
        self._next_seq = hello.next_seq
        self._unanswered: deque[int] = deque()
        self._lost: deque[int] = deque()

    def number(self) -> int:
        """The number of the frame that is about to be sent."""
        seq = self._next_seq
        self._next_seq += 1
        self._unanswered.append(seq)
        return seq

    def forget(self, seq: int) -> None:
        """This one goes out again, under another number: nobody is to hear of it."""
        for frames in (self._unanswered, self._lost):
            if seq in frames:
                frames.remove(seq)

    def next_lost(self) -> Optional[int]:
        """A frame that is lost, once those before it have their answers."""
        is_next = bool(self._lost) and not (self._unanswered and self._unanswered[0] < self._lost[0])
        return self._lost.popleft() if is_next else None

    def is_new(self, message: Message) -> bool:
        """Whether this is no answer that was told before, nor one to a frame that went out again."""
        if not isinstance(message, (Result, Dropped, Error)) or message.seq is None:
            return True
        if message.seq not in self._unanswered:
            return False
        self._unanswered.remove(message.seq)
        return True

    def go_on(self, hello: Hello) -> None:
        """Gives up the frames that the service does not know: of those before its next number it tells by itself."""
        first_unknown = hello.next_seq if hello.resumed else 0
        lost = [seq for seq in self._unanswered if seq >= first_unknown]
        for seq in lost:
            self._unanswered.remove(seq)
        self._lost.extend(lost)
        self._next_seq = max(self._next_seq, hello.next_seq)


class _Lasting(Generic[_Stream]):
    """What both kinds of lasting streams know of theirs."""

    def __init__(self, stream: _Stream, settings: dict[str, Any], patience_s: float) -> None:
        self._stream = stream
        self._settings = settings
        self._patience_s = patience_s
        self._endings = Endings(stream.hello)
        self._is_closed = False
        #: Since the last message that was no ``Hello``: a service may let streams begin and no more.
        self._waits: Optional[Iterator[float]] = None

    @property
    def hello(self) -> Hello:
        """What the service said first that has the stream now."""
        return self._stream.hello

    def _tries(self) -> Iterator[float]:
        """How long to wait before each further try, in seconds."""
        self._waits = self._waits or waits(self._patience_s)
        return self._waits

    def _took_over(self, stream: _Stream) -> None:
        self._stream = stream
        self._endings.go_on(stream.hello)


class LastingStream(_Lasting["Stream"], Closing):
    """A stream that goes on by itself. Every frame gets one answer, in the order sent: one whose service is gone is told as
    ``Dropped``, ``lost``. Made by ``Client.lasting_stream``.

    One thread may send while another receives.
    """

    def __init__(
        self,
        begin: Callable[[dict[str, Any], Optional[ResumePoint]], Stream],
        settings: dict[str, Any],
        patience_s: float,
    ) -> None:
        settings = calls.given(settings)
        super().__init__(begin(settings, None), settings, patience_s)
        self._begin = begin
        self._going_on = threading.Lock()

    def send(
        self,
        frame: Frame,
        *,
        captured_at_ns: Optional[int] = None,
        odometry: Optional[Odometry] = None,
        scan: Optional[Scan] = None,
    ) -> int:
        """Sends an encoded image, and returns its number; as ``Stream.send``."""
        image, beside = calls.frame_bytes(frame), Beside(captured_at_ns, odometry, scan)
        while True:
            stream, seq = self._stream, self._endings.number()
            try:
                stream.send_numbered(image, seq, beside)
                return seq
            except ConnectionLost as error:
                self._endings.forget(seq)
                self._go_on(stream, error)

    def configure(self, **settings: Any) -> None:
        """As ``Stream.configure``; a service that begins the stream anew is told, too."""
        self._settings.update(calls.given(settings))
        while True:
            stream = self._stream
            try:
                return stream.configure(**settings)
            except ConnectionLost as error:
                self._go_on(stream, error)

    def receive(self, timeout: Optional[float] = None) -> Message:
        """The next message. Raises ``TimeoutError`` after ``timeout`` seconds without one, ``ConnectionLost`` where the
        service is out of reach for too long."""
        while True:
            lost = self._endings.next_lost()
            if lost is not None:
                return Dropped(lost, "lost")
            stream = self._stream
            try:
                message = stream.receive(timeout)
            except ConnectionLost as error:
                self._go_on(stream, error)
                continue
            self._waits = None
            if self._endings.is_new(message):
                return message

    def answer(self, timeout: Optional[float] = None) -> Union[Result, Dropped, Error]:
        """The answer to the oldest frame that has none yet; other messages are passed over."""
        while True:
            message = self.receive(timeout)
            if isinstance(message, (Result, Dropped, Error)):
                return message

    def __iter__(self) -> Iterator[Message]:
        """All messages; ends with ``ConnectionLost``."""
        while True:
            yield self.receive()

    def close(self) -> None:
        """Ends the stream."""
        self._is_closed = True
        self._stream.close()

    def _go_on(self, broken: Stream, error: RoomsightError) -> None:
        with self._going_on:
            if self._stream is not broken:
                return
            for wait_s in self._tries():
                if self._is_closed or not may_pass(error):
                    break
                time.sleep(wait_s)
                try:
                    stream = self._begin(self._settings, broken.point)
                except RoomsightError as again:
                    error = again
                    continue
                self._took_over(stream)
                broken.close()
                return
            raise error


class AsyncLastingStream(_Lasting["AsyncStream"], AsyncClosing):
    """The same for programs with ``asyncio``. Made by ``AsyncClient.lasting_stream``.

    One task may send while another receives.
    """

    def __init__(
        self,
        begin: Callable[[dict[str, Any], Optional[ResumePoint]], Awaitable[AsyncStream]],
        settings: dict[str, Any],
        patience_s: float,
        stream: AsyncStream,
    ) -> None:
        super().__init__(stream, calls.given(settings), patience_s)
        self._begin = begin
        self._going_on = asyncio.Lock()

    async def send(
        self,
        frame: Frame,
        *,
        captured_at_ns: Optional[int] = None,
        odometry: Optional[Odometry] = None,
        scan: Optional[Scan] = None,
    ) -> int:
        """Sends an encoded image, and returns its number; as ``AsyncStream.send``."""
        image, beside = calls.frame_bytes(frame), Beside(captured_at_ns, odometry, scan)
        while True:
            stream, seq = self._stream, self._endings.number()
            try:
                await stream.send_numbered(image, seq, beside)
                return seq
            except ConnectionLost as error:
                self._endings.forget(seq)
                await self._go_on(stream, error)

    async def configure(self, **settings: Any) -> None:
        """As ``AsyncStream.configure``; a service that begins the stream anew is told, too."""
        self._settings.update(calls.given(settings))
        while True:
            stream = self._stream
            try:
                return await stream.configure(**settings)
            except ConnectionLost as error:
                await self._go_on(stream, error)

    async def receive(self, timeout: Optional[float] = None) -> Message:
        """The next message. Raises ``asyncio.TimeoutError`` after ``timeout`` seconds without one, ``ConnectionLost`` where
        the service is out of reach for too long."""
        while True:
            lost = self._endings.next_lost()
            if lost is not None:
                return Dropped(lost, "lost")
            stream = self._stream
            try:
                message = await stream.receive(timeout)
            except ConnectionLost as error:
                await self._go_on(stream, error)
                continue
            self._waits = None
            if self._endings.is_new(message):
                return message

    async def answer(self, timeout: Optional[float] = None) -> Union[Result, Dropped, Error]:
        """The answer to the oldest frame that has none yet; other messages are passed over."""
        while True:
            message = await self.receive(timeout)
            if isinstance(message, (Result, Dropped, Error)):
                return message

    async def __aiter__(self) -> AsyncIterator[Message]:
        """All messages; ends with ``ConnectionLost``."""
        while True:
            yield await self.receive()

    async def close(self) -> None:
        """Ends the stream."""
        self._is_closed = True
        await self._stream.close()

    async def _go_on(self, broken: AsyncStream, error: RoomsightError) -> None:
        async with self._going_on:
            if self._stream is not broken:
                return
            for wait_s in self._tries():
                if self._is_closed or not may_pass(error):
                    break
                await asyncio.sleep(wait_s)
                try:
                    stream = await self._begin(self._settings, broken.point)
                except RoomsightError as again:
                    error = again
                    continue
                self._took_over(stream)
                await broken.close()
                return
            raise error
