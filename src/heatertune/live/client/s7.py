"""S7 (ISO on TCP), by rack and slot or, for an S7-200, by TSAPs."""

from __future__ import annotations

import logging
from collections.abc import Callable
from contextlib import suppress
from functools import partial
from typing import Any, Final

from snap7.client import Client
from snap7.error import S7Error, S7ProtocolError
from snap7.logo import Logo

from heatertune.errors import LinkDown, PlcRefused
from heatertune.live.client.connection import Address, RequestConnection, SignOfLife, close_by_reset

__all__ = ["S7Client", "open_client"]

#: what fits into one message of 240 bytes, the smallest that PLCs agree to, both ways
_MOST: Final = 212

#: system status list of operating modes (S7-300/400 system functions, SZL-ID W#16#xy24): its number, and where the
#: present one stands, behind length and number of the records in the low half of a byte
_MODES, _MODE_AT = 0x0424, 7
#: a mode → whether the CPU is in RUN; those of a redundant pair are not known here
_RUNS: Final = {8: True, **dict.fromkeys((1, 2, 3, 4, 5, 6, 7, 10), False)}

logging.getLogger("snap7").addHandler(logging.NullHandler())  # errors tell what happened


class S7Client(RequestConnection):
    """See `heatertune.live.client.connection.Client`."""

    most = _MOST
    whole = True

    def __init__(self, address: Address, library: Any) -> None:
        """Take a client of the library's that is connected."""
        super().__init__(address)
        self._library, self._tells_mode = library, True

    def read(self, number: int, start: int, count: int) -> bytes:
        """Return bytes of a block."""
        what = f"reading {count} bytes of DB{number} from byte {start} on"

        def ask() -> bytes:
            try:
                return bytes(self._library.db_read(number, start, count))
            except S7ProtocolError as problem:
                raise self._refused(what, _why(problem)) from None

        return self._answer_to(ask, what)

    def write(self, number: int, start: int, content: bytes) -> None:
        """Write bytes of a block."""
        what = f"writing {len(content)} bytes of DB{number} from byte {start} on"

        def ask() -> None:
            try:
                self._library.db_write(number, start, bytearray(content))
            except S7ProtocolError as problem:
                raise self._refused(what, _why(problem)) from None

        self._answer_to(ask, what)

    def sign_of_life(self) -> SignOfLife:
        """Return whether the CPU is in RUN, by its system status list; an S7-200 and some gateways have none."""
        what = "asking for the operating mode"

        def ask() -> bool | None:
            try:
                answer = self._library.read_szl(_MODES, 0)
            except (S7ProtocolError, RuntimeError) as problem:
                raise self._refused(what, str(problem)) from None
            record = bytes(answer.Data[: answer.Header.LengthDR])
            return _RUNS.get(record[_MODE_AT] & 0x0F) if len(record) > _MODE_AT else None

        if not self._tells_mode:
            return SignOfLife()
        try:
            return SignOfLife(runs=self._answer_to(ask, what))
        except PlcRefused:
            self._tells_mode = False
            return SignOfLife()

    def _close(self) -> None:
        with suppress(S7Error, OSError):
            self._library.disconnect()


def _why(problem: S7ProtocolError) -> str:
    """Return the PLC's message, and its most frequent cause."""
    return (f"{problem} (there is no such block, it is shorter, write-protected, or, in an S7-1200/1500, an optimized "
            f"block or PUT/GET not permitted: OPC UA needs neither)")


def _waiting(kind: Any, timeout_s: float) -> Any:
    """Return a class of the library's whose connections wait so long for any answer, where its own wait 5 s.

    They are closed by a reset, those too to which nobody answers while they are being made.
    """

    def reset_at_its_end(connection: Any, connect: Callable[[], None]) -> None:
        connect()
        close_by_reset(connection.socket)

    class Waiting(kind):  # type: ignore[misc]
        def __setattr__(self, name: str, value: Any) -> None:
            if name == "connection" and value is not None:
                value.connect = partial(value.connect, timeout_s)
                value._tcp_connect = partial(reset_at_its_end, value, value._tcp_connect)
            super().__setattr__(name, value)

    return Waiting


def open_client(address: Address, timeout_s: float) -> S7Client:
    """Return a client that is connected.

    Raises:
        LinkDown: nobody is there.
    """
    library: Any = _waiting(Logo if address.by_tsap else Client, timeout_s)()
    try:
        library.connect(address.host, *address.way, address.port)
    except (S7Error, OSError) as problem:
        raise LinkDown(f"{address.text}: no S7 connection to {address.host}:{address.port}: {problem}") from None
    return S7Client(address, library)
