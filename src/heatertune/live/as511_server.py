"""A virtual S5 at a pseudo-terminal that speaks AS511, the protocol of its programming port. Not proven on hardware.

As public descriptions have it: each function is a handshake, byte by byte; a data byte 10h is doubled; a refusal is 10h
15h where an acknowledgement was due; after half a second of silence either side begins anew. Addresses count bytes, as
on an S5-115U. No rate is kept: at 9,600 Bd reading 98 bytes takes a quarter of a second, here a few milliseconds.
"""

from __future__ import annotations

import os
from collections.abc import Iterator
from select import select
from threading import Thread
from typing import Final

from heatertune.errors import InputError
from heatertune.live.block_memory import Access, Refusal
from heatertune.live.plc import VirtualPlc
from heatertune.live.simulator_status import OWN

__all__ = ["OWN_DB", "As511Server"]

#: number of the simulator's own block: an S5 has none beyond it
OWN_DB: Final = 255
#: a longer silence ends a function [s]
SILENCE_S = 0.5

_STX: Final = b"\x02"
_ACK, _NAK, _EOT, _ETX = b"\x10\x06", b"\x10\x15", b"\x10\x04", b"\x10\x03"
_GO, _END = b"\x16" + _ETX, b"\x12" + _ETX
_DLE: Final = 0x10
_WRITE: Final = 0x03
_BEGIN: Final = 0x1000  # of the first block's header
_COMPRESSED: Final = 0x0E10  # where it begins after the memory was compressed
_HEADER: Final = 10
_MOST: Final = 2048  # bytes of one request


class _Silence(Exception):
    """Raised when the other side says nothing, or what is not due: the function is over."""


class _ServerStopped(Exception):
    """Raised when nobody wants the server any more."""


class As511Server:
    """One partner at one line, in a thread.

    Attributes:
        device: path of the line that a client opens.
        spoilt: writes beside all blocks, which on a machine would have hit something else: address and bytes.
    """

    def __init__(self, plc: VirtualPlc) -> None:
        """Open a pseudo-terminal and serve on it.

        Raises:
            InputError: this system has none.
        """
        try:
            import tty

            self._line, self._far = os.openpty()
        except (ImportError, AttributeError, OSError) as problem:
            raise InputError(f"as511 needs a pseudo-terminal, which this system does not give: {problem}") from None
        tty.setraw(self._far)  # kept open: without anybody at the other end, reading fails
        self.device, self.spoilt = os.ttyname(self._far), list[tuple[int, bytes]]()
        self._plc, self._memory = plc, plc.memory
        self._numbers = {self._memory.main: self._memory.main, OWN_DB: OWN}
        self._functions = {0x1A: self._info, 0x04: self._read, _WRITE: self._write}
        self._heard = bytearray()
        self._woken, self._wake = os.pipe()
        self._thread = Thread(target=self._serve, name="AS511", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Close the line."""
        os.write(self._wake, b"x")
        self._thread.join()
        for one in (self._line, self._far, self._woken, self._wake):
            os.close(one)

    def _serve(self) -> None:
        while True:
            try:
                if self._hear(patient=True) == _STX[0]:
                    self._function()
            except _Silence:
                self._heard.clear()
            except _ServerStopped:
                return

    def _function(self) -> None:
        """Run one function, from the acknowledgement of its beginning on."""
        self._say(_ACK)
        code = self._hear()
        function = self._functions.get(code)
        if function is None:
            self._say(_NAK)
            return
        self._say(_STX, _ACK)
        self._say(_GO, _ACK)
        try:
            reply = function(self._body())
        except Refusal:
            self._say(_NAK)
            return
        self._delay(code)
        self._say(_ACK)
        if reply:
            self._say(_STX, _ACK)
            self._say(reply.replace(b"\x10", b"\x10\x10") + _ETX, _ACK)
        self._say(_STX, _ACK)
        self._say(_END, _ACK)

    def _body(self) -> bytes:
        """Return the bytes before 10 04."""
        body = bytearray()
        while True:
            byte = self._hear()
            if byte == _DLE:
                byte = self._hear()
                if byte == _EOT[1]:
                    return bytes(body)
                if byte != _DLE:
                    raise _Silence
            body.append(byte)

    # the line

    def _hear(self, *, patient: bool = False) -> int:
        """Return the next byte; who is not patient waits no longer for it than the protocol allows."""
        while not self._heard:
            ready, _, _ = select([self._line, self._woken], [], [], None if patient else SILENCE_S)
            if self._woken in ready:
                raise _ServerStopped
            if not ready:
                raise _Silence
            content = os.read(self._line, 4096)
            if not self._dead():
                self._heard += content
        return self._heard.pop(0)

    def _say(self, what: bytes, then: bytes = b"") -> None:
        """Send bytes, and wait for those that are due then."""
        if not self._dead():
            os.write(self._line, what)
        for byte in then:
            if self._hear() != byte:
                raise _Silence

    def _dead(self) -> bool:
        return self._plc.link("cut") is not None or self._plc.link("black-hole") is not None

    def _delay(self, code: int) -> None:
        """Wait, or say nothing more, where the timetable has the reply late or lost.

        Without any reply no request could arrive here: what is lost is that to a write.
        """
        if code == _WRITE and self._plc.link("lost-reply") is not None:
            raise _Silence
        late = self._plc.link("late-reply")
        if late is not None:
            due = self._plc.intervals + int(late.value)
            with self._memory.changed:
                self._memory.changed.wait_for(lambda: self._plc.intervals >= due or self._plc.ended)

    # the functions

    def _places(self) -> Iterator[tuple[int, int, int]]:
        """Yield number, address of DW 0 and bytes of each block that is there."""
        address = _BEGIN if self._plc.link("compressed") is None else _COMPRESSED
        for number, block_name in self._numbers.items():
            address += _HEADER
            if not (block_name == self._memory.main and self._memory.missing):
                yield number, address, self._memory.block_size(block_name)
            address += self._memory.size(block_name)

    def _info(self, body: bytes) -> bytes:
        """Return the answer to 1Ah about a block: its address and its header."""
        for number, address, length in self._places():
            if body == bytes((1, number)):
                return b"\0" + address.to_bytes(2, "big") + self._header(number, length)
        raise Refusal(Access.MISSING)

    def _header(self, number: int, length: int) -> bytes:
        """Return the five words before DW 0: mark, type and number, programming unit, library, length in words."""
        return bytes((0x70, 0x70, 0x41, number, 0, 0, 0, 0)) + (length // 2 + _HEADER // 2).to_bytes(2, "big")

    def _read(self, body: bytes) -> bytes:
        """Return the answer to 04h: the blocks at their addresses, and nothing next to them."""
        first, last = (int.from_bytes(body[at : at + 2], "big") for at in (0, 2))
        if len(body) != 4 or not first <= last < first + _MOST:
            raise Refusal(Access.OUTSIDE)
        cells = bytearray(last + 1 - first)
        with self._memory.changed:
            for number, address, length in self._places():
                content = self._header(number, length) + self._memory.read(self._numbers[number], 0, length)
                for at, byte in enumerate(content, start=address - _HEADER):
                    if first <= at <= last:
                        cells[at - first] = byte
        return bytes(5) + bytes(cells)

    def _write(self, body: bytes) -> bytes:
        """Write what 03h writes; refuse what reaches over the end of a block, or into a header."""
        first, content = int.from_bytes(body[:2], "big"), body[2:]
        if not content or len(content) > _MOST:
            raise Refusal(Access.OUTSIDE)
        end = first + len(content)
        for number, address, length in self._places():
            if end <= address - _HEADER or first >= address + length:
                continue
            self._memory.write(self._numbers[number], first - address, content)
            return b""
        self.spoilt.append((first, content))
        return b""
