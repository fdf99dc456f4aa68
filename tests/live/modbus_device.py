"""A Modbus device of our own on loopback, with plain sockets: what it stores and what it answers a test decides."""

import socket
import struct
import threading


class Device:
    """Holding registers; `stored` may change what is written, `answered` what is read.

    Attributes:
        memory: bytes of the registers.
        writes: first register and bytes of each write request.
        stored: (first register, bytes) → bytes that are kept in their place.
        answered: (first register, bytes) → bytes that are answered.
    """

    def __init__(self, memory):
        self.memory, self.writes, self.reads = bytearray(memory), [], 0
        self.stored = self.answered = lambda _, data: data
        self._lock = threading.Lock()
        self._door = socket.create_server(("127.0.0.1", 0))
        self.port = self._door.getsockname()[1]
        threading.Thread(target=self._accept, daemon=True).start()

    def close(self):
        self._door.close()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.close()

    def _accept(self):
        while True:
            try:
                link, _ = self._door.accept()
            except OSError:
                return
            threading.Thread(target=self._serve, args=(link,), daemon=True).start()

    def _serve(self, link):
        with link:
            while head := _exactly(link, 7):
                number, _, length, unit = struct.unpack(">HHHB", head)
                answer = self._answer(_exactly(link, length - 1))
                link.sendall(struct.pack(">HHHB", number, 0, len(answer) + 1, unit) + answer)

    def _answer(self, request):
        function, first, count = struct.unpack(">BHH", request[:5])
        place = slice(2 * first, 2 * first + 2 * count)
        with self._lock:
            if place.stop > len(self.memory):
                return bytes([function | 0x80, 2])
            if function == 3:
                self.reads += 1
                data = self.answered(first, bytes(self.memory[place]))
                return bytes([3, len(data)]) + data
            if function == 16:
                self.writes.append((first, request[6:]))
                self.memory[place] = self.stored(first, request[6:])
                return request[:5]
        return bytes([function | 0x80, 1])


def _exactly(link, count):
    data = b""
    while len(data) < count:
        try:
            more = link.recv(count - len(data))
        except OSError:
            return b""
        if not more:
            return b""
        data += more
    return data
