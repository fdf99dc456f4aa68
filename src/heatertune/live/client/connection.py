"""The connection to a PLC: its address, and the client that all protocols share.

A client reads and writes bytes of a block, one request at a time, and never repeats a write. It also asks a simulated
PLC for its status. Addresses: `s7://HOST:PORT/RACK/SLOT/dbN`,
`modbus://HOST:PORT/UNIT/REGISTER[?heartbeat=REGISTER]`, `opc.tcp://HOST:PORT/PATH/NODE` or `as511://DEVICE/dbN`.
"""

from __future__ import annotations

import os
import re
import socket
import struct
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import dataclass
from importlib import import_module
from importlib.util import find_spec
from types import TracebackType
from typing import Any, Final, NamedTuple, Protocol, Self, TypeVar
from urllib.parse import urlsplit

from heatertune.errors import InputError, LinkDown, PlcRefused, ReplyLost, UnknownName
from heatertune.live.simulator_status import OWN, OWN_LENGTH, SimulatorStatus

__all__ = [
    "EXAMPLES", "LIBRARIES", "Address", "Client", "ClosesOnExit", "RequestConnection", "SignOfLife", "address_of",
    "close_by_reset", "connect", "demand_library", "status_of_simulator",
]


#: scheme → an address of it
EXAMPLES: Final[Mapping[str, str]] = {
    "s7": "s7://192.168.0.10/0/2/db30 (rack, slot, block) or s7://192.168.0.10/10.00/10.01/db1 (an S7-200's TSAPs)",
    "modbus": "modbus://192.168.0.10/1/0 (unit, first register of the block) or modbus://192.168.0.10/1/0?heartbeat=90 "
              "(a register that the program counts up)",
    "opc.tcp": "opc.tcp://192.168.0.10/ns=3;s=NAME (the variable that holds the block's bytes) or "
               "opc.tcp://127.0.0.1:4840/db30 (of a virtual PLC)",
    "as511": "as511:///dev/ttyUSB0/db30 or as511://COM3/db30 (serial line, block)",
    "mqtt": "mqtt://192.168.0.10 or mqtt://USER@192.168.0.10:1883 (a broker, for record alone: --map names the topics)",
}
_PORTS: Final = {"s7": 102, "modbus": 502, "opc.tcp": 4840, "mqtt": 1883}
_TSAP: Final = re.compile(r"([0-9a-fA-F]{1,2})\.([0-9a-fA-F]{1,2})")
_BLOCK: Final = re.compile(r"db([1-9]\d{0,4})", re.IGNORECASE)
_NODE: Final = re.compile(r"/(ns=\d{1,5};(?:s=.+|i=\d{1,10})|db[1-9]\d{0,4})$", re.IGNORECASE)
_MOST_BLOCK: Final = {"s7": 65535, "opc.tcp": 65535, "as511": 255}


@dataclass(frozen=True, slots=True, kw_only=True)
class Address:
    """Where a PLC is.

    Attributes:
        text: as it was given.
        protocol: one of `heatertune.live.client.connection.LIBRARIES`.
        host, port: of the PLC; AS511: the serial device, and 0.
        way: S7: rack and slot, or both TSAPs; Modbus: the unit alone; else nothing.
        by_tsap: whether `way` holds TSAPs, the client's own first.
        block: S7, AS511: number of the data block, None where none is said; Modbus: first register of the block.
        path, node: OPC UA: of the endpoint, and the variable that holds the block.
        heartbeat: Modbus: register that moves as long as the program runs; None: none is said.
        user: MQTT: as whom to ask the broker; empty: as nobody.
    """

    text: str
    protocol: str
    host: str
    port: int
    way: tuple[int, ...] = ()
    by_tsap: bool = False
    block: int | None = None
    path: str = ""
    node: str = ""
    heartbeat: int | None = None
    user: str = ""


def address_of(text: str) -> Address:
    """Return the address that a line says.

    Raises:
        InputError: it is none; the message shows one that is.
        UnknownName: no such protocol.
    """
    scheme, mark, _ = text.partition("://")
    if not mark:
        raise InputError(f"address {text!r}: expected {' or '.join(EXAMPLES.values())}")
    scheme = scheme.lower()
    if scheme not in EXAMPLES:
        raise UnknownName("protocol", scheme, EXAMPLES)
    return _READ[scheme](text)


def _s7(text: str) -> Address:
    where, path = _network(text, "s7", text)
    rest, block = _parts(path), None
    if rest and _BLOCK.fullmatch(rest[-1]):
        block = _block(text, "s7", rest.pop())
    if len(rest) != 2:
        raise _wrong(text, "s7", "no rack and slot")
    tsaps = [_TSAP.fullmatch(part) for part in rest]
    if all(tsaps):
        way = tuple(int(match[1], 16) << 8 | int(match[2], 16) for match in tsaps if match)
        return Address(**where, way=way, by_tsap=True, block=block)
    rack, slot = (_whole(text, "s7", what, part, most)
                  for what, part, most in zip(("rack", "slot"), rest, (7, 31), strict=True))
    return Address(**where, way=(rack, slot), block=block)


def _modbus(text: str) -> Address:
    url, mark, beat = text.partition("?heartbeat=")
    where, path = _network(text, "modbus", url)
    rest = _parts(path)
    if not 1 <= len(rest) <= 2:
        raise _wrong(text, "modbus", "no unit" if not rest else "more than unit and register")
    first = _whole(text, "modbus", "register", rest[1], 65535) if len(rest) > 1 else 0
    return Address(**where, way=(_whole(text, "modbus", "unit", rest[0], 255),), block=first,
                   heartbeat=_whole(text, "modbus", "heartbeat", beat, 65535) if mark else None)


def _opcua(text: str) -> Address:
    match = _NODE.search(text)  # a name may hold what ends the path of a URL
    if match is None:
        raise _wrong(text, "opc.tcp", "no node")
    where, path = _network(text, "opc.tcp", text[: match.start()])
    node, block = match[1], None
    if _BLOCK.fullmatch(node):
        block = _block(text, "opc.tcp", node)
        node = f"ns=2;s=DB{block}"
    return Address(**where | {"protocol": "opcua"}, block=block, path=path, node=node)


def _mqtt(text: str) -> Address:
    user, mark, rest = text.partition("://")[2].rpartition("@")
    if ":" in user:
        raise _wrong(text.replace(user, "USER"), "mqtt", "a password in the address; say it in "
                     "HEATERTUNE_MQTT_PASSWORD")
    if mark and not user:
        raise _wrong(text, "mqtt", "no user before @")
    where, path = _network(text, "mqtt", f"mqtt://{rest}")
    if path.strip("/"):
        raise _wrong(text, "mqtt", f"{path!r} behind the host")
    return Address(**where, user=user)


def _as511(text: str) -> Address:
    device, mark, block = text.partition("://")[2].rpartition("/")
    if not mark or not device or not _BLOCK.fullmatch(block):
        raise _wrong(text, "as511", "no serial line" if _BLOCK.fullmatch(block) else "no block")
    return Address(text=text, protocol="as511", host=device, port=0, block=_block(text, "as511", block))


_READ: Final[Mapping[str, Callable[[str], Address]]] = {
    "s7": _s7, "modbus": _modbus, "opc.tcp": _opcua, "as511": _as511, "mqtt": _mqtt,
}


def _network(text: str, scheme: str, url: str) -> tuple[dict[str, Any], str]:
    """Return the parts that all addresses in a network have, and the path."""
    try:
        parts = urlsplit(url)
        host, port = parts.hostname, parts.port
    except ValueError as problem:
        raise _wrong(text, scheme, str(problem)) from None
    if not host or parts.username is not None or parts.query or parts.fragment:
        raise _wrong(text, scheme, "no host" if not host else "more than host, port and path")
    if port == 0:
        raise _wrong(text, scheme, "port 0")
    return {"text": text, "protocol": scheme, "host": host, "port": port or _PORTS[scheme]}, parts.path


def _parts(path: str) -> list[str]:
    return [part for part in path.split("/") if part]


def _block(text: str, scheme: str, name: str) -> int:
    number = int(name[2:])
    if number > _MOST_BLOCK[scheme]:
        raise _wrong(text, scheme, f"block {name} is beyond db{_MOST_BLOCK[scheme]}")
    return number


def _whole(text: str, scheme: str, what: str, name: str, most: int) -> int:
    if not (name.isascii() and name.isdigit() and len(name) < 7 and int(name) <= most):
        raise _wrong(text, scheme, f"{what} {name!r} is no whole number 0…{most}")
    return int(name)


def _wrong(text: str, scheme: str, problem: str) -> InputError:
    return InputError(f"address {text!r}: {problem}; expected {EXAMPLES[scheme]}")


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


class ClosesOnExit:
    """A context manager that ends by `close`."""

    def close(self) -> None:
        """Close it."""
        raise NotImplementedError

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, problem: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


class SignOfLife(NamedTuple):
    """What a protocol tells of the CPU behind what was read last.

    Attributes:
        runs: whether it says that it is in RUN; None: nothing tells.
        stamp: what moves with each new content; None: nothing tells.
    """

    runs: bool | None = None
    stamp: object = None

    def is_new(self, last: SignOfLife) -> bool | None:
        """Return whether what was read is of another instant than at the last look; None: nothing tells."""
        return None if self.stamp is None else self.stamp != last.stamp


class RequestConnection(ClosesOnExit):
    """A connection that is closed at the first request without an answer."""

    def sign_of_life(self) -> SignOfLife:
        """Return the protocol's report on the CPU; errors as `Client.read`."""
        return SignOfLife()

    def __init__(self, address: Address) -> None:
        """Belong to an address."""
        self._address, self._open, self._under_way = address, True, False

    def _answer_to(self, ask: Callable[[], Answer], what: str) -> Answer:
        """Return the answer to a request; `ask` raises `PlcRefused`, `LinkDown` or anything of the library's own."""
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


#: protocol → the module that it needs, and the extra that brings it
LIBRARIES: Final[Mapping[str, tuple[str, str]]] = {
    "s7": ("snap7", "s7"), "modbus": ("pymodbus", "modbus"), "opcua": ("asyncua", "opcua"),
    "as511": ("serial", "serial"),
}
#: of what is only recorded, the same
_SOURCES: Final[Mapping[str, tuple[str, str]]] = {"mqtt": ("paho", "mqtt")}
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

    def sign_of_life(self) -> SignOfLife:
        """Return the protocol's report on the CPU behind the last read; errors as `read`."""

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
    if address.protocol in _SOURCES:
        raise InputError(f"{address.text}: a broker has no block to read or write; it is for heatertune record alone")
    demand_library(address.protocol)
    module = import_module(f"heatertune.live.client.{address.protocol}")
    client: Client = module.open_client(address, timeout_s)
    return client


def demand_library(protocol: str) -> None:
    """Do nothing where a protocol's library is installed.

    Raises:
        InputError: it is not; the message names the extra.
    """
    module, extra = {**LIBRARIES, **_SOURCES}[protocol]
    if find_spec(module) is None:
        raise InputError(f'{protocol} needs {module}: pip install "heatertune[{extra}]"')


def status_of_simulator(client: Client) -> SimulatorStatus | None:
    """Return the content of the simulator's own block; None: this is no simulator.

    Raises:
        LinkError: no answer.
    """
    try:
        status = SimulatorStatus(client.read(OWN, 0, OWN_LENGTH))
    except PlcRefused:
        return None
    return status if status.marked else None
