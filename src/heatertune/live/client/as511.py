"""AS511, the protocol of an S5's programming port, over a serial line. Not proven on hardware.

A data block is memory at an address that moves: when the block is sent anew, or the memory is compressed. So its
address is asked for before each write and after it, and after each read. Words that are written together do not reach
the CPU together: a scan may run between two of them.
"""

from __future__ import annotations

import os
import time
from collections.abc import Callable
from contextlib import suppress
from typing import Any, Final, NamedTuple, TypeVar

import serial

from heatertune.errors import LinkDown, PlcRefused, ReplyLost
from heatertune.live.client.connection import Address, RequestConnection
from heatertune.live.simulator_status import OWN

__all__ = ["As511Client", "open_client"]

#: bytes of one request
_MOST: Final = 512
#: so long a programming unit leaves a CPU alone that has refused [s]
PAUSE_S = 0.5
#: number of the block that stands for the simulator's own
_OWN_DB: Final = 255
_LOOKS: Final = 3

_DATA_BLOCK: Final = 0x01
_BLOCK_INFO, _READ, _WRITE = 0x1A, 0x04, 0x03
_START: Final = bytes.fromhex("02")
_YES: Final = bytes.fromhex("10 06")
_NO: Final = bytes.fromhex("10 15")
_CARRY_ON: Final = bytes.fromhex("16 10 03")
_OVER: Final = bytes.fromhex("12 10 03")
_HEADER_WORDS: Final = 5

Answer = TypeVar("Answer")


class _Refused(Exception):
    """Raised when the CPU says no."""


class _BlockAddress(NamedTuple):
    """Where a block is: address of its first data word, and its bytes."""

    address: int
    length: int


class As511Client(RequestConnection):
    """See `heatertune.live.client.connection.Client`."""

    most = _MOST
    whole = False

    def __init__(self, address: Address, line: Any) -> None:
        """Take a serial line that is open."""
        super().__init__(address)
        self._line, self._sent = line, False
        self._places: dict[int, _BlockAddress] = {}
        self._again = 0.0

    def read(self, number: int, start: int, count: int) -> bytes:
        """Return bytes of a block."""
        what = f"reading {count} bytes of DB{_db(number)} from byte {start} on"

        def ask() -> bytes:
            place = self._places.pop(number, None) or self._info(number)
            for _ in range(_LOOKS):
                first = self._within(place, start, count, what)
                answer = self._exchange(_READ, first.to_bytes(2, "big") + (first + count - 1).to_bytes(2, "big"))
                was, place = place, self._info(number)
                if place == was:
                    if answer[:5] != bytes(5) or len(answer) != 5 + count:
                        raise ConnectionError(f"{len(answer)} bytes came, {answer[:5].hex(' ')} first")
                    self._places[number] = place
                    return answer[5:]
            raise ConnectionError("the block moves at each look")

        return self._talked(ask, what)

    def write(self, number: int, start: int, content: bytes) -> None:
        """Write bytes of a block."""
        what = f"writing {len(content)} bytes of DB{_db(number)} from byte {start} on"

        self._sent = False

        def ask() -> None:
            try:
                self._write(number, start, content, what)
            except (ConnectionError, TimeoutError, serial.SerialException) as problem:
                if self._sent:
                    raise
                raise LinkDown(f"{self._address.text}: no answer before {what}: {problem}") from None

        self._talked(ask, what)

    def present(self) -> None:
        """Do nothing where a CPU answers, with or without the block.

        Raises:
            LinkDown: none does.
        """
        try:
            self._talked(lambda: self._info(self._address.block or 1), "asking for the block")
        except PlcRefused:
            pass
        except ReplyLost as problem:
            raise LinkDown(str(problem)) from None

    def _write(self, number: int, start: int, content: bytes, what: str) -> None:
        """Write bytes of a block, and see that it was there before and after."""
        place = self._info(number)
        first = self._within(place, start, len(content), what)
        self._exchange(_WRITE, first.to_bytes(2, "big") + content, replies=False)
        try:
            after = self._info(number)
        except Exception as problem:
            raise ConnectionError(f"where the block is now is not known: {problem}") from None
        if after != place:
            raise ConnectionError(f"the block moved from {place.address:04X} to {after.address:04X} meanwhile: what "
                                  f"was overwritten is not known")

    def _talked(self, ask: Callable[[], Answer], what: str) -> Answer:
        """Return the result of `ask`; report a refusal."""

        def asked() -> Answer:
            try:
                return ask()
            except _Refused:
                raise self._refused(what, "there is no such block, it is protected, or the CPU is busy") from None

        return self._answer_to(asked, what)

    def _within(self, place: _BlockAddress, start: int, count: int, what: str) -> int:
        """Return the address of bytes of a block; refuse those that it has not."""
        if start < 0 or count < 1 or start + count > place.length:
            raise self._refused(what, f"it has {place.length} bytes")
        return place.address + start

    def _info(self, number: int) -> _BlockAddress:
        """Return where a block is."""
        answer = self._exchange(_BLOCK_INFO, bytes((_DATA_BLOCK, _db(number))))
        if len(answer) != 13 or answer[0] or answer[3:7] != bytes((0x70, 0x70, 0x40 + _DATA_BLOCK, _db(number))):
            raise ConnectionError(f"{answer.hex(' ')} is not where DB{_db(number)} is")
        return _BlockAddress(int.from_bytes(answer[1:3], "big"),
                             2 * (int.from_bytes(answer[11:13], "big") - _HEADER_WORDS))

    def _exchange(self, function: int, body: bytes, *, replies: bool = True) -> bytes:
        """Run one function of the CPU, and return what it replies."""
        time.sleep(max(0.0, self._again - time.monotonic()))
        self._line.write(_START)
        self._await(_YES)
        self._line.write(bytes((function,)))
        self._await(_START)
        self._line.write(_YES)
        self._await(_CARRY_ON)
        self._sent = self._sent or function == _WRITE
        self._line.write(_YES + _doubled(body) + b"\x10\x04")
        self._await(_YES)
        data = b""
        if replies:
            self._await(_START, accepted=True)
            self._line.write(_YES)
            data = self._data()
            self._line.write(_YES)
        self._await(_START, accepted=True)
        self._line.write(_YES)
        self._await(_OVER, accepted=True)
        self._line.write(_YES)
        return data

    def _await(self, wanted: bytes, *, accepted: bool = False) -> None:
        """Take the bytes that are due; what is accepted is refused no more."""
        answer = b""
        while answer != wanted:
            answer += self._byte()
            if answer == _NO and not accepted:
                self._again = time.monotonic() + PAUSE_S
                raise _Refused
            if not wanted.startswith(answer) and (accepted or not _NO.startswith(answer)):
                raise ConnectionError(f"{answer.hex(' ')} came, {wanted.hex(' ')} was due")

    def _data(self) -> bytes:
        """Take data until 10 03; of a data byte 10h two come."""
        content = bytearray()
        while True:
            byte = self._byte()
            if byte == b"\x10":
                byte = self._byte()
                if byte == b"\x03":
                    return bytes(content)
                if byte != b"\x10":
                    raise ConnectionError(f"10 {byte.hex()} came within data")
            content += byte

    def _byte(self) -> bytes:
        byte: bytes = self._line.read(1)
        if not byte:
            raise TimeoutError(f"silence for {self._line.timeout:g} s")
        return byte

    def _close(self) -> None:
        if self._under_way:  # the system would still send what waits there
            with suppress(Exception):
                self._line.reset_output_buffer()
        with suppress(OSError):
            self._line.close()


def _doubled(body: bytes) -> bytes:
    return b"".join(b"\x10\x10" if byte == 0x10 else bytes((byte,)) for byte in body)


def _db(number: int) -> int:
    """Return the number that a block has there."""
    return _OWN_DB if number == OWN else number


def open_client(address: Address, timeout_s: float) -> As511Client:
    """Return a client whose line is open, and at whose other end a CPU answers.

    Raises:
        LinkDown: no such line, it is another's, or nobody answers.
    """
    # a pseudo-terminal has no parity to check, and takes none
    pseudo = os.path.realpath(address.host).startswith("/dev/pts/")
    try:
        line = serial.Serial(
            address.host, 9600, bytesize=8, parity="N" if pseudo else "E", stopbits=1, timeout=timeout_s,
            write_timeout=timeout_s, exclusive=True)
    except Exception as problem:  # the library's own, or the system's for what the line cannot be set to
        raise LinkDown(f"{address.text}: no serial line {address.host}: {problem}") from None
    client = As511Client(address, line)
    try:
        line.reset_input_buffer()
        client.present()
    except BaseException:
        client.close()
        raise
    return client
