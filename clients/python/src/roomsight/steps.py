"""Calls that are written once, as steps, and made by both clients."""

from __future__ import annotations

import asyncio
import functools
import time
from collections.abc import Coroutine, Generator
from dataclasses import dataclass, field
from types import MethodType
from typing import TYPE_CHECKING, Any, Callable, Generic, Optional, TypeVar, Union, overload

import httpx

from . import calls

if TYPE_CHECKING:
    from typing_extensions import Concatenate, ParamSpec

    P = ParamSpec("P")
else:
    # Python has it from 3.10 on; only type checkers need it.
    P = TypeVar("P")

T = TypeVar("T")


@dataclass(frozen=True)
class Request:
    """A request to the service; ``arguments`` are httpx's. It is answered by an ``httpx.Response``."""

    method: str
    url: str
    arguments: dict[str, Any] = field(default_factory=dict)


@dataclass(frozen=True)
class Pause:
    """Some time in which nothing is asked."""

    seconds: float


#: What leads to a value: requests and pauses, one after the other.
Steps = Generator[Union[Request, Pause], Any, T]


def ask(kind: type[T], method: str, url: str, **arguments: Any) -> Steps[T]:
    """One request, and the value of its answer."""
    return calls.read_answer(kind, (yield Request(method, url, arguments)))


def tell(method: str, url: str, **arguments: Any) -> Steps[None]:
    """One request whose answer says nothing more than that it is done."""
    calls.check_done((yield Request(method, url, arguments)))


def fetch(url: str, **arguments: Any) -> Steps[bytes]:
    """The bytes at an address, such as those of a picture."""
    response: httpx.Response = yield Request("GET", url, arguments)
    calls.check_done(response)
    return response.content


class Caller:
    """Takes steps, and waits for each."""

    def __init__(self, http: httpx.Client) -> None:
        self._http = http

    def run(self, steps: Steps[T]) -> T:
        """The value that the steps lead to. Raises ``Refused``, ``ConnectionLost`` or ``ProtocolError``."""
        response: Optional[httpx.Response] = None
        while True:
            try:
                step = steps.send(response)
            except StopIteration as end:
                value: T = end.value
                return value
            if isinstance(step, Pause):
                time.sleep(step.seconds)
                response = None
            else:
                response = self._call(step.method, step.url, **step.arguments)

    def _call(self, method: str, url: str, **arguments: Any) -> httpx.Response:
        try:
            return self._http.request(method, url, **arguments)
        except httpx.HTTPError as error:
            raise calls.lost(error) from error


class AsyncCaller:
    """Takes steps, and lets other tasks run meanwhile."""

    def __init__(self, http: httpx.AsyncClient) -> None:
        self._http = http

    async def run(self, steps: Steps[T]) -> T:
        """The value that the steps lead to. Raises ``Refused``, ``ConnectionLost`` or ``ProtocolError``."""
        response: Optional[httpx.Response] = None
        while True:
            try:
                step = steps.send(response)
            except StopIteration as end:
                value: T = end.value
                return value
            if isinstance(step, Pause):
                await asyncio.sleep(step.seconds)
                response = None
            else:
                response = await self._call(step.method, step.url, **step.arguments)

    async def _call(self, method: str, url: str, **arguments: Any) -> httpx.Response:
        try:
            return await self._http.request(method, url, **arguments)
        except httpx.HTTPError as error:
            raise calls.lost(error) from error


class Method(Generic[P, T]):
    """Steps as a method of both callers: a ``Caller`` returns their value, an ``AsyncCaller`` is awaited. A decorator."""

    def __init__(self, steps: Callable[Concatenate[Any, P], Steps[T]]) -> None:
        self._steps = steps

    @overload
    def __get__(self, caller: Caller, kind: Any = None) -> Callable[P, T]: ...

    @overload
    def __get__(self, caller: AsyncCaller, kind: Any = None) -> Callable[P, Coroutine[Any, Any, T]]: ...

    @overload
    def __get__(self, caller: None, kind: Any = None) -> Callable[..., Steps[T]]: ...

    def __get__(self, caller: Union[Caller, AsyncCaller, None], kind: Any = None) -> Any:
        if caller is None:
            return self._steps
        steps = MethodType(self._steps, caller)

        @functools.wraps(steps)
        def method(*args: P.args, **kwargs: P.kwargs) -> Any:
            return caller.run(steps(*args, **kwargs))

        return method
