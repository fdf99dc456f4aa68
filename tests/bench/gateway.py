"""A Modbus TCP server of our own that misbehaves as gateways do: it keeps requests, loses answers, and serves whoever comes.

It shares nothing with heatertune. What its registers hold is what a test judges by.
"""

import contextlib
import socket
import struct
import threading


class Gateway:
    """Holding registers from 0 on; one thread a connection.

    Attributes:
        memory: bytes of the registers.
        writes: of each request that was carried out: first byte and content.
        hold_s: request number → how long it is kept, unanswered, before it is carried out, whatever becomes of its connection [s].
        reads: that were answered.
        silent: whether requests are neither answered nor carried out.
        seen: called with the number of each write before anything is done.
        looked: called with the number of each read.
    """

    def __init__(self, memory, *, moves=None):
        """Serve; `moves` is the first byte of a REAL that changes a little from read to read."""
        self.memory, self.writes, self.hold_s, self.silent = bytearray(memory), [], {}, False
        self.seen = self.looked = lambda _number: None
        self._moves, self.reads, self._asked, self._lock = moves, 0, 0, threading.Lock()
        self._listener = socket.create_server(("127.0.0.1", 0))
        self.port = self._listener.getsockname()[1]
        self._open = [self._listener]
        threading.Thread(target=self._accept, daemon=True).start()

    def close(self):
        for each in self._open:
            with contextlib.suppress(OSError):
                each.shutdown(socket.SHUT_RDWR)
            each.close()

    def _accept(self):
        with contextlib.suppress(OSError):
            while True:
                connection, _ = self._listener.accept()
                self._open.append(connection)
                threading.Thread(target=self._serve, args=(connection,), daemon=True).start()

    def _serve(self, connection):
        with contextlib.suppress(OSError, struct.error), connection, connection.makefile("rb") as requests:
            while head := requests.read(7):
                number, _, length, unit = struct.unpack(">HHHB", head)
                reply = self._answer(requests.read(length - 1))
                if reply and not self.silent:
                    connection.sendall(struct.pack(">HHHB", number, 0, len(reply) + 1, unit) + reply)

    def _answer(self, request):
        if self.silent:
            return b""
        function, first, count = struct.unpack(">BHH", request[:5])
        begin, end = 2 * first, 2 * (first + count)
        if function not in (3, 16) or end > len(self.memory):
            return bytes((function | 0x80, 2 if function in (3, 16) else 1))
        if function == 3:
            self.reads += 1
            self.looked(self.reads)
            with self._lock:
                if self._moves is not None:
                    self.memory[self._moves : self._moves + 4] = struct.pack(">f", 40.0 + 0.3 * (self.reads % 5))
                return bytes((3, end - begin)) + self.memory[begin:end]
        self._asked += 1
        self.seen(self._asked)
        if self.silent:
            return b""
        if (wait_s := self.hold_s.get(self._asked)) is not None:
            timer = threading.Timer(wait_s, self._put, (begin, request[6:]))
            timer.daemon = True
            timer.start()
            return b""
        self._put(begin, request[6:])
        return request[:5]

    def _put(self, begin, content):
        with self._lock:
            self.memory[begin : begin + len(content)] = content
            self.writes.append((begin, bytes(content)))
