"""A client of a PLC: bytes of its blocks, read and written one request at a time, and never a write twice."""

from __future__ import annotations

from collections.abc import Mapping
from importlib import import_module
from importlib.util import find_spec
from types import TracebackType
from typing import Final, Protocol, Self

from heatertune.errors import InputError
from heatertune.live.client.address import Address

__all__ = ["LIBRARIES", "Client", "connect", "demand_library"]

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
