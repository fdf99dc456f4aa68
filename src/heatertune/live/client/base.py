"""What clients of every protocol have in common: one request, what it ends in, and the end."""

from __future__ import annotations

from collections.abc import Callable
from types import TracebackType
from typing import Self, TypeVar

from heatertune.errors import LinkDown, PlcRefused, ReplyLost
from heatertune.live.client.address import Address

__all__ = ["Asking"]

Answer = TypeVar("Answer")


class Asking:
    """A connection that is closed at the first request without an answer."""

    def __init__(self, address: Address) -> None:
        """Belong to an address."""
        self._address, self._open = address, True

    def _asked(self, ask: Callable[[], Answer], what: str) -> Answer:
        """Return what a request answers; `ask` raises `PlcRefused`, `LinkDown` or anything of the library's own."""
        if not self._open:
            raise LinkDown(f"{self._address.text}: the connection is closed")
        try:
            return ask()
        except PlcRefused:
            raise
        except LinkDown:
            self.close()
            raise
        except Exception as problem:  # whatever the library raises: what the PLC did is not known
            self.close()
            raise ReplyLost(f"{self._address.text}: no answer to {what}: {problem}") from None

    def _refused(self, what: str, why: str) -> PlcRefused:
        return PlcRefused(f"{self._address.text}: {what} refused: {why}")

    def close(self) -> None:
        """Close the connection."""
        if self._open:
            self._open = False
            self._close()

    def _close(self) -> None:
        raise NotImplementedError

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, problem: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
