"""The keys of a service: what it tells of them, and the calls."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass, field
from typing import Optional

from . import calls
from .steps import AsyncCaller, Caller, Method, Steps, ask, tell
from .types import named


@dataclass(frozen=True)
class KeyInfo:
    """A key, without what opens it. ``role`` is ``viewer``, ``robot`` or ``admin``; ``robots`` are those that it alone may speak
    for. ``origin`` is ``settings``, or ``page`` where it was made by a call."""

    name: str
    role: str
    robots: list[str]
    origin: str = named("from")
    made_at: Optional[str] = None


@dataclass(frozen=True)
class KeyList:
    """The keys that are valid."""

    keys: list[KeyInfo]


@dataclass(frozen=True)
class NewKey:
    """A new key: ``key`` is what a ``Client`` takes, and is told this once."""

    name: str
    role: str
    key: str = field(repr=False)


#: A class with a method `list` cannot say so.
_Keys = list[KeyInfo]


class _KeyCalls:
    """The calls about keys."""

    @Method
    def list(self) -> Steps[_Keys]:
        """The keys that are valid: those of the settings first."""
        return (yield from ask(KeyList, "GET", "/v1/keys")).keys

    @Method
    def make(self, name: str, role: str, *, robots: Iterable[str] = ()) -> Steps[NewKey]:
        """Makes a key. The first one of a service without keys must be one of an ``admin``: from then on keys are needed."""
        return ask(NewKey, "POST", "/v1/keys", json={"name": name, "role": role, "robots": [*robots]})

    @Method
    def revoke(self, name: str) -> Steps[None]:
        """Revokes a key. Whoever uses it is out at once."""
        return tell("DELETE", calls.path("keys", name))


class Keys(_KeyCalls, Caller):
    """The keys of a service. ``Client.keys``."""


class AsyncKeys(_KeyCalls, AsyncCaller):
    """The keys of a service. ``AsyncClient.keys``."""
