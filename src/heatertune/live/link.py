"""A link that fails: what stands between clients and a protocol's server where the timetable has faults of the link."""

from __future__ import annotations

import socket
from collections.abc import Callable
from selectors import EVENT_READ, DefaultSelector
from threading import Thread
from typing import Final

from heatertune.live.plc import VirtualPlc

__all__ = ["FaultyLink"]

_MOST: Final = 65536
_LOOK_S: Final = 0.02  # so often a link that is cut, or a reply that is late, is seen to


class _Pair:
    """A client's connection and the one to the server behind it."""

    def __init__(self, client: socket.socket, server: socket.socket) -> None:
        self.client, self.server = client, server
        self.late: list[tuple[int, bytes]] = []

    def close(self) -> None:
        self.client.close()
        self.server.close()


class FaultyLink:
    """A proxy on loopback, in one thread."""

    def __init__(self, plc: VirtualPlc, listener: socket.socket, server: tuple[str, int]) -> None:
        """Stand between.

        Args:
            plc: whose timetable has the faults.
            listener: where clients come to.
            server: where the protocol is served.
        """
        self._plc, self._listener, self._server = plc, listener, server
        self._selector, self._pairs = DefaultSelector(), list[_Pair]()
        self._wake, self._woken = socket.socketpair()
        listener.setblocking(False)
        self._selector.register(listener, EVENT_READ, self._accept)
        self._selector.register(self._woken, EVENT_READ, None)
        self._thread = Thread(target=self._run, name="link", daemon=True)
        self._thread.start()

    def stop(self) -> None:
        """Close all connections, and the door."""
        self._wake.send(b"x")
        self._thread.join()

    def _run(self) -> None:
        while True:
            for key, _ in self._selector.select(_LOOK_S):
                if key.data is None:
                    self._end()
                    return
                key.data()
            if self._plc.link("cut") is not None:
                for pair in list(self._pairs):
                    self._drop(pair)
            for pair in list(self._pairs):
                self._send_late(pair)

    def _end(self) -> None:
        for pair in list(self._pairs):
            self._drop(pair)
        self._selector.close()
        for one in (self._listener, self._wake, self._woken):
            one.close()

    def _accept(self) -> None:
        client, _ = self._listener.accept()
        if self._plc.link("cut") is not None:
            client.close()
            return
        pair = _Pair(client, socket.create_connection(self._server))
        self._pairs.append(pair)
        for source, act in ((client, self._asked), (pair.server, self._answered)):
            source.setsockopt(socket.IPPROTO_TCP, socket.TCP_NODELAY, 1)
            self._selector.register(source, EVENT_READ, _with(act, pair))

    def _drop(self, pair: _Pair) -> None:
        if pair in self._pairs:
            self._pairs.remove(pair)
            for one in (pair.client, pair.server):
                self._selector.unregister(one)
            pair.close()

    def _asked(self, pair: _Pair) -> None:
        request = self._received(pair, pair.client)
        if request and self._plc.link("black-hole") is None:
            self._sent(pair, pair.server, request)

    def _answered(self, pair: _Pair) -> None:
        reply = self._received(pair, pair.server)
        if not reply or self._plc.link("black-hole") is not None or self._plc.link("lost-reply") is not None:
            return
        late = self._plc.link("late-reply")
        if late is None and not pair.late:
            self._sent(pair, pair.client, reply)
        else:  # nor does a later reply overtake
            pair.late.append((self._plc.intervals + (0 if late is None else int(late.value)), reply))

    def _send_late(self, pair: _Pair) -> None:
        while pair.late and self._plc.intervals >= pair.late[0][0]:
            self._sent(pair, pair.client, pair.late.pop(0)[1])

    def _received(self, pair: _Pair, source: socket.socket) -> bytes:
        if pair not in self._pairs:
            return b""
        try:
            content = source.recv(_MOST)
        except OSError:
            content = b""
        if not content:
            self._drop(pair)
        return content

    def _sent(self, pair: _Pair, to: socket.socket, content: bytes) -> None:
        try:
            to.sendall(content)
        except OSError:
            self._drop(pair)


def _with(act: Callable[[_Pair], None], pair: _Pair) -> Callable[[], None]:
    return lambda: act(pair)
