"""A virtual PLC over S7 (ISO on TCP): every rack, slot and TSAP, so that clients of an S7-200 find it, too."""

from __future__ import annotations

import logging
import socket
import struct
from contextlib import suppress
from threading import Thread
from typing import Any, Final

from snap7.server import CPUState, Server, ServerState
from snap7.type import SrvArea

from heatertune.live.block_memory import Access, Refusal
from heatertune.live.plc import VirtualPlc

__all__ = ["S7Server"]

#: return codes of an item: object does not exist, address out of range, access denied
_CODES: Final = {Access.MISSING: 0x0A, Access.OUTSIDE: 0x05, Access.PROTECTED: 0x03}
_GOOD: Final = 0xFF
_BIT: Final = 1  # word length
#: system status list of operating modes (SZL-ID W#16#0424): bytes of its record, RUN and STOP
_MODES, _MODE_LENGTH, _RUN, _STOP = 0x0424, 20, 8, 4

logging.getLogger("snap7").addHandler(logging.NullHandler())  # what a client does wrong is no message of the PLC


class S7Server(Server):  # type: ignore[misc]
    """The library's server; what it reads, writes, starts and stops is the virtual PLC."""

    def __init__(self, plc: VirtualPlc, listener: socket.socket) -> None:
        """Serve on a socket that listens.

        Args:
            plc: to be served.
            listener: on loopback.
        """
        self._plc: VirtualPlc | None = None
        self._sockets = set[socket.socket]()
        super().__init__(log=False)
        self._plc, self._memory = plc, plc.memory
        for number in plc.memory.numbers:  # lists of blocks tell these; their content comes from the memory
            self.register_area(SrvArea.DB, number, bytearray(plc.memory.size(number)))
        self.host, self.port = listener.getsockname()
        self.server_socket, self.running, self.state = listener, True, ServerState.RUNNING
        self.server_thread = Thread(target=self._server_loop, name="S7", daemon=True)
        self.server_thread.start()

    @property
    def cpu_state(self) -> CPUState:
        """Whether the CPU is in RUN, as clients ask."""
        return CPUState.RUN if self._plc is not None and self._plc.runs else CPUState.STOP

    @cpu_state.setter
    def cpu_state(self, state: CPUState) -> None:
        if self._plc is not None and self.running:
            self._plc.stop_cpu(state == CPUState.STOP)

    def stop(self) -> int:
        """Close all connections, and the door."""
        if self.running:
            self._plc = None  # so that the library's own last state is not the CPU's
        self.running = False
        if self.server_socket is not None:
            _shut(self.server_socket)  # so that the library does not wait for a client first, where the system tells it
        if self.server_thread is not None:
            self.server_thread.join()
        for one in list(self._sockets):
            _shut(one)
        for thread in list(self.clients):
            thread.join()
        if self.server_socket is not None:
            self.server_socket.close()
        return 0

    def _handle_client(self, client_socket: socket.socket, address: tuple[str, int]) -> None:
        self._sockets.add(client_socket)
        try:
            super()._handle_client(client_socket, address)
        finally:
            self._sockets.discard(client_socket)

    def _get_szl_data(self, szl_id: int, szl_index: int) -> bytes | None:
        """Return a system status list: that of the operating modes, which the library has not, is the virtual PLC's."""
        if szl_id != _MODES:
            answer: bytes | None = super()._get_szl_data(szl_id, szl_index)
            return answer
        mode = _RUN if self.cpu_state == CPUState.RUN else _STOP
        return struct.pack(">HH2xBB16x", _MODE_LENGTH, 1, 0xFF, mode)

    def _read_from_memory_area(self, area: Any, db_number: int, start: int, count: int) -> tuple[int, bytearray]:
        if (area, db_number) not in self.memory_areas:
            return _CODES[Access.MISSING], bytearray()
        try:
            return _GOOD, bytearray(self._memory.read(db_number, start, count))
        except Refusal as refused:
            return _CODES[refused.why], bytearray()

    def _write_to_memory_area(self, area: Any, db_number: int, start: int, write_data: bytearray) -> bool:
        if (area, db_number) not in self.memory_areas:
            return False
        try:
            self._memory.write(db_number, start, bytes(write_data))
        except Refusal:
            return False
        return True

    def _parse_write_address(self, request: dict[str, Any]) -> Any:
        """Return what is to be written; None, which the client is told, for what the library would write wrongly.

        Of several items in one request it writes the first alone, and of a bit the whole byte.
        """
        parameters = request.get("parameters", {})
        bits = parameters.get("address_spec", {}).get("word_len") == _BIT
        return None if bits or parameters.get("item_count", 1) != 1 else super()._parse_write_address(request)


def _shut(connection: socket.socket) -> None:
    with suppress(OSError):  # it has gone already
        connection.shutdown(socket.SHUT_RDWR)

