"""Where a PLC is, as one line says it.

`s7://HOST:PORT/RACK/SLOT/dbN`, `modbus://HOST:PORT/UNIT/REGISTER`, `opc.tcp://HOST:PORT/PATH/NODE` or
`as511://DEVICE/dbN`.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final
from urllib.parse import urlsplit

from heatertune.errors import InputError, UnknownName

__all__ = ["EXAMPLES", "Address", "address_of"]

#: scheme → an address of it
EXAMPLES: Final[Mapping[str, str]] = {
    "s7": "s7://192.168.0.10/0/2/db30 (rack, slot, block) or s7://192.168.0.10/10.00/10.01/db1 (an S7-200's TSAPs)",
    "modbus": "modbus://192.168.0.10/1/0 (unit, first register of the block)",
    "opc.tcp": "'opc.tcp://192.168.0.10/ns=3;s=\"Recipe\".\"Block\"' (node of the block's bytes) or "
               "opc.tcp://127.0.0.1:4840/db30 (of a virtual PLC)",
    "as511": "as511:///dev/ttyUSB0/db30 or as511://COM3/db30 (serial line, block)",
}
_PROTOCOLS: Final = {"opc.tcp": "opcua"}  # the others are called as their scheme
_PORTS: Final = {"s7": 102, "modbus": 502, "opcua": 4840}
_TSAP: Final = re.compile(r"([0-9a-fA-F]{1,2})\.([0-9a-fA-F]{1,2})")
_BLOCK: Final = re.compile(r"db([1-9]\d{0,4})", re.IGNORECASE)
_MOST_BLOCK: Final = 65535


@dataclass(frozen=True, slots=True, kw_only=True)
class Address:
    """Where a PLC is.

    Attributes:
        text: as it was given.
        protocol: one of `EXAMPLES`.
        host, port: of the PLC.
        way: S7: rack and slot, or both TSAPs; Modbus: the unit alone.
        by_tsap: whether `way` holds TSAPs, the client's own first.
        block: S7: number of the data block, None where none is said; Modbus: first register of the block.
    """

    text: str
    protocol: str
    host: str
    port: int
    way: tuple[int, ...]
    by_tsap: bool = False
    block: int | None = None


def address_of(text: str) -> Address:
    """Return the address that a line says.

    Raises:
        InputError: it is none; the message shows one that is.
        UnknownName: no such protocol.
    """
    protocol, mark, _ = text.partition("://")
    if not mark:
        raise InputError(f"address {text!r}: expected {' or '.join(EXAMPLES.values())}")
    protocol = protocol.lower()
    if protocol not in EXAMPLES:
        raise UnknownName("protocol", protocol, EXAMPLES)
    try:
        parts = urlsplit(text)
        host, port = parts.hostname, parts.port
    except ValueError as problem:
        raise _wrong(text, protocol, str(problem)) from None
    if not host or parts.username is not None or parts.query or parts.fragment:
        raise _wrong(text, protocol, "no host" if not host else "more than host, port and path")
    if port == 0:
        raise _wrong(text, protocol, "port 0")
    rest = [part for part in parts.path.split("/") if part]
    way, by_tsap, block = _READ[protocol](text, rest)
    return Address(text=text, protocol=protocol, host=host, port=port or _PORTS[protocol], way=way, by_tsap=by_tsap,
                   block=block)


def _s7(text: str, rest: list[str]) -> tuple[tuple[int, ...], bool, int | None]:
    block = None
    if rest and (found := _BLOCK.fullmatch(rest[-1])):
        block = int(found[1])
        if block > _MOST_BLOCK:
            raise _wrong(text, "s7", f"block {rest[-1]}")
        del rest[-1]
    if len(rest) != 2:
        raise _wrong(text, "s7", "no rack and slot")
    tsaps = [_TSAP.fullmatch(part) for part in rest]
    if all(tsaps):
        return tuple(int(found[1], 16) << 8 | int(found[2], 16) for found in tsaps if found), True, block
    return (_whole(text, "s7", "rack", rest[0], 7), _whole(text, "s7", "slot", rest[1], 31)), False, block


def _modbus(text: str, rest: list[str]) -> tuple[tuple[int, ...], bool, int | None]:
    if not 1 <= len(rest) <= 2:
        raise _wrong(text, "modbus", "no unit" if not rest else "more than unit and register")
    first = _whole(text, "modbus", "register", rest[1], 65535) if len(rest) > 1 else 0
    return (_whole(text, "modbus", "unit", rest[0], 255),), False, first


_READ: Final[Mapping[str, Callable[[str, list[str]], tuple[tuple[int, ...], bool, int | None]]]] = {
    "s7": _s7, "modbus": _modbus,
}


def _whole(text: str, protocol: str, what: str, found: str, most: int) -> int:
    if not (found.isascii() and found.isdigit() and len(found) < 7 and int(found) <= most):
        raise _wrong(text, protocol, f"{what} {found!r} is no whole number 0…{most}")
    return int(found)


def _wrong(text: str, protocol: str, problem: str) -> InputError:
    return InputError(f"address {text!r}: {problem}; expected {EXAMPLES[protocol]}")
