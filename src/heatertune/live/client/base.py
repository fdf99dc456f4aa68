"""What clients of every protocol have in common: one request, what it ends in, and the end."""

from __future__ import annotations

import os
import socket
import struct
from collections.abc import Callable
from contextlib import suppress
from types import TracebackType
from typing import Any, Final, Self, TypeVar

from heatertune.errors import LinkDown, PlcRefused, ReplyLost
from heatertune.live.client.address import Address

__all__ = ["RequestConnection", "close_by_reset"]

Answer = TypeVar("Answer")

#: on, and no time to linger; Windows has two short integers where others have two integers
_LINGER: Final = struct.pack("hh" if os.name == "nt" else "ii", 1, 0)


def close_by_reset(connection: Any) -> None:
    """Have the system end a TCP connection by a reset, whoever closes its socket: this program, its library, its death.

    An orderly end lets the system send again, for minutes, a request that has been given up: behind an outage of the
    network it would reach the PLC long after. A reset discards what has not been acknowledged.

    Args:
        connection: socket of the connection, or asyncio's wrapper of one; None: there is none.
    """
    if connection is not None:
        with suppress(OSError):  # closed already
            connection.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, _LINGER)


class RequestConnection:
    """A connection that is closed at the first request without an answer."""

    def __init__(self, address: Address) -> None:
        """Belong to an address."""
        self._address, self._open, self._under_way = address, True, False

    def _asked(self, ask: Callable[[], Answer], what: str) -> Answer:
        """Return what a request answers; `ask` raises `PlcRefused`, `LinkDown` or anything of the library's own."""
        if not self._open:
            raise LinkDown(f"{self._address.text}: the connection is closed")
        self._under_way = True
        try:
            answer = ask()
        except PlcRefused:
            self._under_way = False
            raise
        except LinkDown:
            self.close()
            raise
        except Exception as problem:  # whatever the library raises: what the PLC did is not known
            self.close()
            raise ReplyLost(f"{self._address.text}: no answer to {what}: {problem}") from None
        self._under_way = False
        return answer

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
