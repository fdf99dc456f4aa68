"""A broker of MQTT 3.1.1 on loopback, with plain sockets: quality of service 0, retained messages, users (OASIS standard, chapter 3)."""

import contextlib
import socket
import struct
import threading


class Broker:
    """Passes on what is published; `with` ends it.

    Attributes:
        port: on loopback.
        users: name → password; empty: nobody is asked.
        refused: topics that may not be subscribed to.
        subscribed: a condition, and the topics that somebody listens to.
    """

    def __init__(self, users=None, refused=()):
        self.users, self.refused, self.kept = users or {}, refused, {}
        self.subscribed, self.listeners = threading.Condition(), {}
        self.door = socket.create_server(("127.0.0.1", 0))
        self.port = self.door.getsockname()[1]
        self.links = set()
        threading.Thread(target=self._accept, daemon=True).start()

    def __enter__(self):
        return self

    def __exit__(self, *_):
        with contextlib.suppress(OSError):
            self.door.shutdown(socket.SHUT_RDWR)
        self.door.close()
        self.cut()

    def cut(self):
        """Close all connections."""
        for link in list(self.links):
            with contextlib.suppress(OSError):
                link.shutdown(socket.SHUT_RDWR)

    def publish(self, topic, payload, retain=False):
        """Pass a message on to those who listen, and keep it for others where that is wanted."""
        if retain:
            self.kept[topic] = payload
        with self.subscribed:
            for link in list(self.listeners.get(topic, ())):
                self._send(link, topic, payload, 0)

    def await_listener(self, topic):
        """Wait until somebody listens to a topic."""
        with self.subscribed:
            assert self.subscribed.wait_for(lambda: self.listeners.get(topic), 20)

    def _send(self, link, topic, payload, retain):
        body = struct.pack(">H", len(topic.encode())) + topic.encode() + payload
        with contextlib.suppress(OSError):
            link.sendall(bytes([0x30 | retain]) + _length(len(body)) + body)

    def _accept(self):
        while True:
            try:
                link, _ = self.door.accept()
            except OSError:
                return
            self.links.add(link)
            threading.Thread(target=self._serve, args=(link,), daemon=True).start()

    def _serve(self, link):
        with link, contextlib.suppress(OSError, EOFError):
            while True:
                kind, body = _packet(link)
                if not self._answered(link, kind, body):
                    break
        self.links.discard(link)
        with self.subscribed:
            for listeners in self.listeners.values():
                listeners.discard(link)

    def _answered(self, link, kind, body):
        if kind >> 4 == 1:  # CONNECT
            flags, fields = body[7], _fields(body[10:])
            given = tuple(field.decode() for field in fields[1:3]) if flags & 0x80 else None
            good = not self.users or (given is not None and self.users.get(given[0]) == (given[1] if len(given) > 1 else None))
            link.sendall(bytes([0x20, 2, 0, 0 if good else 5]))
            return good
        if kind >> 4 == 8:  # SUBSCRIBE
            topics, at = [], 2
            while at < len(body):
                size, = struct.unpack_from(">H", body, at)
                topics.append(body[at + 2 : at + 2 + size].decode())
                at += size + 3
            link.sendall(bytes([0x90, 2 + len(topics)]) + body[:2] + bytes(0x80 if topic in self.refused else 0 for topic in topics))
            with self.subscribed:
                for topic in topics:
                    if topic in self.kept:
                        self._send(link, topic, self.kept[topic], 1)
                    self.listeners.setdefault(topic, set()).add(link)
                self.subscribed.notify_all()
        if kind >> 4 == 3:  # PUBLISH
            size, = struct.unpack_from(">H", body)
            self.publish(body[2 : 2 + size].decode(), body[2 + size :], bool(kind & 1))
        if kind >> 4 == 12:  # PINGREQ
            link.sendall(bytes([0xD0, 0]))
        return kind >> 4 != 14  # DISCONNECT


def _fields(rest):
    found = []
    while rest:
        size, = struct.unpack_from(">H", rest)
        found.append(rest[2 : 2 + size])
        rest = rest[2 + size :]
    return found


def _exactly(link, count):
    data = b""
    while len(data) < count:
        more = link.recv(count - len(data))
        if not more:
            raise EOFError
        data += more
    return data


def _length(number):
    found = b""
    while True:
        number, low = number >> 7, number & 127
        found += bytes([low | 128 * bool(number)])
        if not number:
            return found


def _packet(link):
    kind, shift, length = _exactly(link, 1)[0], 0, 0
    while True:
        byte = _exactly(link, 1)[0]
        length |= (byte & 127) << shift
        shift += 7
        if not byte & 128:
            return kind, _exactly(link, length)
