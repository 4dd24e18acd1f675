"""What is closed where its ``with`` ends."""

from __future__ import annotations

from typing import TypeVar

_Opened = TypeVar("_Opened", bound="Closing")
_AsyncOpened = TypeVar("_AsyncOpened", bound="AsyncClosing")


class Closing:
    """Has a ``close``, and calls it at the end of its ``with``."""

    def close(self) -> None:
        """Gives back what is held."""
        raise NotImplementedError

    def __enter__(self: _Opened) -> _Opened:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


class AsyncClosing:
    """Has a ``close`` to be awaited, and awaits it at the end of its ``async with``."""

    async def close(self) -> None:
        """Gives back what is held."""
        raise NotImplementedError

    async def __aenter__(self: _AsyncOpened) -> _AsyncOpened:
        return self

    async def __aexit__(self, *_: object) -> None:
        await self.close()
