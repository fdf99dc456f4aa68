"""A client of a PLC: bytes of its blocks, read and written one request at a time, and never a write twice.

What clients of every protocol have in common: one request, what it ends in, and the end.

What a simulated PLC says of itself to a client that asks for it.
"""

from __future__ import annotations

import os
import socket
import struct
from collections.abc import Callable, Mapping
from contextlib import suppress
from importlib import import_module
from importlib.util import find_spec
from types import TracebackType
from typing import Any, Final, Protocol, Self, TypeVar

from heatertune.errors import InputError, LinkDown, PlcRefused, ReplyLost
from heatertune.live.client.address import Address
from heatertune.live.memory import OWN, OWN_LENGTH, SimulatorStatus

__all__ = [
    "LIBRARIES",
    "Client",
    "RequestConnection",
    "close_by_reset",
    "connect",
    "demand_library",
    "told_by",
]


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


#: protocol → the module that it needs, and the extra that brings it
LIBRARIES: Final[Mapping[str, tuple[str, str]]] = {
    "s7": ("snap7", "s7"), "modbus": ("pymodbus", "modbus"), "opcua": ("asyncua", "opcua"),
    "as511": ("serial", "serial"),
}
_TIMEOUT_S: Final = 2.0


class Client(Protocol):
    """A connection to a PLC; `with` closes it.

    After `LinkDown` or `ReplyLost` it is closed for good: a late answer must not be taken for another one's.

    Attributes:
        most: bytes that one request reads or writes.
        whole: whether these are of one instant; if not, a scan may run between two of the words.
    """

    most: int
    whole: bool

    def read(self, number: int, start: int, count: int) -> bytes:
        """Return bytes of a block, in one request.

        Args:
            number: of the block; over Modbus and OPC UA, the simulator's own or any other for the controller's.
            start: of its first byte.
            count: of bytes, at most `most`.

        Raises:
            PlcRefused: the PLC says that there is no such block or byte.
            LinkDown, ReplyLost: it cannot be reached, or does not answer.
        """

    def write(self, number: int, start: int, content: bytes) -> None:
        """Write bytes of a block, in one request, once.

        Over Modbus whole registers.

        Raises:
            PlcRefused: the PLC does not take it; nothing has changed.
            LinkDown: it was not sent.
            ReplyLost: whether it arrived is not known.
        """

    def close(self) -> None:
        """Close the connection; harmless where it is closed."""

    def __enter__(self) -> Self: ...

    def __exit__(
        self, kind: type[BaseException] | None, problem: BaseException | None, trace: TracebackType | None
    ) -> None: ...


def connect(address: Address, timeout_s: float = _TIMEOUT_S) -> Client:
    """Return a client that is connected.

    Args:
        address: of the PLC.
        timeout_s: after which an answer is lost [s].

    Raises:
        InputError: the protocol's library is not installed.
        LinkDown: nobody is there, or it does not speak the protocol.
    """
    demand_library(address.protocol)
    module = import_module(f"heatertune.live.client.{address.protocol}")
    client: Client = module.open_client(address, timeout_s)
    return client


def demand_library(protocol: str) -> None:
    """Do nothing where a protocol's library is installed.

    Raises:
        InputError: it is not; the message names the extra.
    """
    module, extra = LIBRARIES[protocol]
    if find_spec(module) is None:
        raise InputError(f'{protocol} needs {module}: pip install "heatertune[{extra}]"')


def told_by(client: Client) -> SimulatorStatus | None:
    """Return what the simulator's own block says; None: this is no simulator.

    Raises:
        LinkError: no answer.
    """
    try:
        told = SimulatorStatus(client.read(OWN, 0, OWN_LENGTH))
    except PlcRefused:
        return None
    return told if told.marked else None
