"""Modbus TCP: a block is a row of holding registers, the high byte first."""

from __future__ import annotations

import logging
from contextlib import suppress
from typing import Any, Final

from pymodbus.client import ModbusTcpClient
from pymodbus.pdu import ExceptionResponse

from heatertune.errors import LinkDown
from heatertune.live.client.connection import Address, RequestConnection, SignOfLife, close_by_reset
from heatertune.live.simulator_status import OWN

__all__ = ["ModbusClient", "open_client"]

#: registers that one request reads or writes (Modbus Application Protocol 1.1b3, sections 6.3, 6.12)
_MOST: Final = 123
#: exception codes (section 7); 5: it was accepted and takes longer, 11: a gateway passed it on and heard nothing
_CODES: Final = {1: "the function is not known", 2: "there is no such register", 3: "the value is not taken",
                 4: "the device has failed, or is write-protected", 6: "the device is busy",
                 10: "the gateway finds no way to the unit"}

logging.getLogger("pymodbus").addHandler(logging.NullHandler())  # errors tell what happened


class ModbusClient(RequestConnection):
    """See `heatertune.live.client.connection.Client`."""

    most = 2 * _MOST
    whole = True

    def __init__(self, address: Address, library: Any) -> None:
        """Take a client of the library's that is connected."""
        super().__init__(address)
        self._library = library

    def read(self, number: int, start: int, count: int) -> bytes:
        """Return bytes of a block; registers are read whole."""
        before = start % 2
        first, registers = self._register(number, start), (before + count + 1) // 2
        what = f"reading registers {first}…{first + registers - 1}"
        answer = self._answer_to(lambda: self._good(
            self._library.read_holding_registers(first, count=registers, device_id=self._address.way[0]), what), what)
        content = b"".join(register.to_bytes(2, "big") for register in answer.registers)
        return content[before : before + count]

    def write(self, number: int, start: int, content: bytes) -> None:
        """Write bytes of a block.

        Raises:
            ValueError: half a register.
        """
        if start % 2 or len(content) % 2:
            raise ValueError(f"byte {start} to {start + len(content)}: registers are written whole")
        first = self._register(number, start)
        registers = [int.from_bytes(content[at : at + 2], "big") for at in range(0, len(content), 2)]
        what = f"writing registers {first}…{first + len(registers) - 1}"
        self._answer_to(lambda: self._good(
            self._library.write_registers(first, registers, device_id=self._address.way[0]), what), what)

    def sign_of_life(self) -> SignOfLife:
        """Return the value of the heartbeat register, where the address names one."""
        register = self._address.heartbeat
        if register is None:
            return SignOfLife()
        what = f"reading the heartbeat, register {register}"
        answer = self._answer_to(lambda: self._good(
            self._library.read_holding_registers(register, count=1, device_id=self._address.way[0]), what), what)
        return SignOfLife(stamp=answer.registers[0])

    def _register(self, number: int, start: int) -> int:
        begins = OWN if number == OWN else self._address.block or 0
        return begins + start // 2

    def _good(self, answer: Any, what: str) -> Any:
        """Return an answer that is none of an error's."""
        if isinstance(answer, ExceptionResponse) and answer.exception_code in _CODES:
            raise self._refused(what, f"{_CODES[answer.exception_code]} (exception {answer.exception_code})")
        if answer.isError():
            raise ConnectionError(str(answer))
        return answer

    def _close(self) -> None:
        with suppress(OSError):
            self._library.close()


def open_client(address: Address, timeout_s: float) -> ModbusClient:
    """Return a client that is connected.

    Raises:
        LinkDown: nobody is there.
    """
    library: Any = ModbusTcpClient(address.host, port=address.port, timeout=timeout_s, retries=0)  # a write goes once
    if not library.connect():
        raise LinkDown(f"{address.text}: no Modbus connection to {address.host}:{address.port}")
    close_by_reset(library.socket)
    return ModbusClient(address, library)
