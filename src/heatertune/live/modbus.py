"""A virtual PLC over Modbus TCP: the block's words as holding registers, the simulator's own from 1000 on.

Where a block says no other registers, its word w is register w.
"""

from __future__ import annotations

import asyncio
import logging
import socket
from threading import Event, Thread
from typing import Any, Final

from pymodbus.constants import ExcCodes
from pymodbus.server import ModbusTcpServer
from pymodbus.simulator import DataType, SimData, SimDevice

from heatertune.live.layout import Run
from heatertune.live.memory import OWN, Access, Refusal
from heatertune.live.plc import VirtualPlc

__all__ = ["FIRST", "UNIT", "ModbusServer"]

#: address of the PLC
UNIT: Final = 1
#: register at which the simulator's own block begins
FIRST: Final = OWN
_CODES: Final = {Access.MISSING: ExcCodes.ILLEGAL_ADDRESS, Access.OUTSIDE: ExcCodes.ILLEGAL_ADDRESS,
                 Access.PROTECTED: ExcCodes.DEVICE_FAILURE}
#: functions on holding registers: read, write one, write many, mask, write and read
_HOLDING: Final = (3, 6, 16, 22, 23)

logging.getLogger("pymodbus").addHandler(logging.NullHandler())


class ModbusServer:
    """The library's server in a thread of its own; its registers are the memory of the virtual PLC."""

    def __init__(self, plc: VirtualPlc, listener: socket.socket) -> None:
        """Serve on a socket that listens.

        Args:
            plc: to be served.
            listener: on loopback; its port is taken over.
        """
        self._memory, self._address = plc.memory, listener.getsockname()
        self._runs = {OWN: [Run(FIRST, 0, self._memory.size(OWN) // 2)], self._memory.main: plc.registers}
        self._ready, self._problem = Event(), ""
        self._listener = listener
        self._loop = asyncio.new_event_loop()
        self._thread = Thread(target=self._serve, name="Modbus", daemon=True)
        self._thread.start()
        self._ready.wait()

    def stop(self) -> None:
        """Close all connections, and the door."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._end.set)
        self._thread.join()

    def _serve(self) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._until_stopped())
        finally:
            self._loop.close()

    async def _until_stopped(self) -> None:
        self._end = asyncio.Event()
        runs = sorted(run for each in self._runs.values() for run in each)
        device = SimDevice(id=UNIT, action=self._accessed, simdata=[
            SimData(run.first, count=run.size, values=0, datatype=DataType.REGISTERS) for run in runs])
        server = ModbusTcpServer(device, address=self._address)
        create = self._loop.create_server
        server.call_create = lambda: create(server.handle_new_connection, sock=self._listener)
        await server.serve_forever(background=True)
        self._ready.set()
        await self._end.wait()
        await server.shutdown()
        rest = asyncio.all_tasks() - {asyncio.current_task()}
        for task in rest:
            task.cancel()
        await asyncio.gather(*rest, return_exceptions=True)

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
                found = self._memory.read(number, place, 2 * count)
                registers[address - start : address - start + count] = [
                    int.from_bytes(found[at : at + 2], "big") for at in range(0, len(found), 2)]
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
