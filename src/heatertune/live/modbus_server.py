"""A virtual PLC over Modbus TCP: the block's words as holding registers, the simulator's own from 1000 on.

Where a block says no other registers, its word w is register w.
"""

from __future__ import annotations

import logging
import socket
from collections.abc import AsyncIterator
from contextlib import asynccontextmanager
from typing import Any, Final

from pymodbus.constants import ExcCodes
from pymodbus.server import ModbusTcpServer
from pymodbus.server.requesthandler import ServerRequestHandler
from pymodbus.simulator import DataType, SimData, SimDevice

from heatertune.live.block_memory import Access, Refusal, RegisterRange
from heatertune.live.plc import VirtualPlc
from heatertune.live.simulator_status import OWN
from heatertune.live.thread_server import AsideServer

__all__ = ["FIRST", "UNIT", "ModbusServer"]

#: address of the PLC
UNIT: Final = 1
#: register at which the simulator's own block begins
FIRST: Final = OWN
_CODES: Final = {Access.MISSING: ExcCodes.ILLEGAL_ADDRESS, Access.OUTSIDE: ExcCodes.ILLEGAL_ADDRESS,
                 Access.PROTECTED: ExcCodes.DEVICE_FAILURE}
#: functions on holding registers: read, write one, write many, mask, write and read
_HOLDING: Final = (3, 6, 16, 22, 23)
#: bytes, more than the longest request has
_PIECE: Final = 512

logging.getLogger("pymodbus").addHandler(logging.NullHandler())


class _ModbusConnection(ServerRequestHandler):  # type: ignore[misc]
    """A connection of the library's, which notes all that it is sent as text, however long, for its messages."""

    def data_received(self, data: bytes) -> None:
        for at in range(0, len(data), _PIECE):
            super().data_received(data[at : at + _PIECE])

    def pause_writing(self) -> None:
        """Take no more requests of a client that takes no answers."""
        self.transport.pause_reading()

    def resume_writing(self) -> None:
        """Take requests again."""
        self.transport.resume_reading()


class _TcpServer(ModbusTcpServer):  # type: ignore[misc]
    def callback_new_connection(self) -> _ModbusConnection:
        return _ModbusConnection(self, self.trace_packet, self.trace_pdu, self.trace_connect)


class ModbusServer(AsideServer):
    """The library's server; its registers are the memory of the virtual PLC."""

    def __init__(self, plc: VirtualPlc, listener: socket.socket) -> None:
        """Serve on a socket that listens.

        Args:
            plc: to be served.
            listener: on loopback; its port is taken over.
        """
        self._memory, self._address = plc.memory, listener.getsockname()
        self._runs = {OWN: [RegisterRange(FIRST, 0, self._memory.size(OWN) // 2)], **plc.register_ranges}
        super().__init__("Modbus", listener)

    @asynccontextmanager
    async def serving(self) -> AsyncIterator[None]:
        """Serve; see `heatertune.live.thread_server.AsideServer`."""
        runs = sorted(run for each in self._runs.values() for run in each)
        device = SimDevice(id=UNIT, action=self._accessed, simdata=[
            SimData(run.first, count=run.size, values=0, datatype=DataType.REGISTERS) for run in runs])
        server = _TcpServer(device, address=self._address)
        await server.serve_forever(background=True)
        yield
        await server.shutdown()

    async def _accessed(
        self, function: int, start: int, address: int, count: int, registers: list[int], values: Any
    ) -> ExcCodes | None:
        """Give the library the registers that it is to read, or take those that it has to write."""
        if function not in _HOLDING:
            return ExcCodes.ILLEGAL_FUNCTION
        number, place = self._place(address, len(values) if values else count)
        try:
            if values:
                self._memory.write(number, place, b"".join(v.to_bytes(2, "big") for v in values))
            else:
                content = self._memory.read(number, place, 2 * count)
                registers[address - start : address - start + count] = [
                    int.from_bytes(content[at : at + 2], "big") for at in range(0, len(content), 2)]
        except Refusal as refused:
            return _CODES[refused.why]
        return None

    def _place(self, address: int, count: int) -> tuple[int, int]:
        """Return block and first byte of registers; a place that is none where they are not in one run."""
        for number, runs in self._runs.items():
            for run in runs:
                if run.first <= address and address + count <= run.first + run.size:
                    return number, run.byte + 2 * (address - run.first)
        return self._memory.main, -1
