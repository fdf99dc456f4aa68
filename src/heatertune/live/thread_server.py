"""A library's asyncio server in a thread of its own, at a socket that listens already."""

from __future__ import annotations

import asyncio
import socket
from collections.abc import Callable
from contextlib import AbstractAsyncContextManager
from threading import Event, Thread
from typing import Any, Final

__all__ = ["AsideServer"]

#: of ending what is left: a request of the last moment may have begun something yet
_ROUNDS: Final = 10


class _SocketLoop(asyncio.SelectorEventLoop):
    """A loop whose server takes a socket that listens over, where the library would open one of its own."""

    def __init__(self, listener: socket.socket, connections: Callable[[Any], Any]) -> None:
        self._listener, self._connections = listener, connections
        super().__init__()

    async def create_server(self, factory: Any, *_: Any, **__: Any) -> Any:  # type: ignore[override]
        return await super().create_server(self._connections(factory), sock=self._listener)


class AsideServer:
    """One server; a protocol says in `serving` how its library is begun and ended."""

    def __init__(self, name: str, listener: socket.socket) -> None:
        """Begin, and return when the server answers.

        Args:
            name: of the thread.
            listener: on loopback; its port is taken over.
        """
        self._ready = Event()
        self._listener, self._loop = listener, _SocketLoop(listener, self.connections)
        self._thread = Thread(target=self._run, name=name, daemon=True)
        self._thread.start()
        self._ready.wait()

    def serving(self) -> AbstractAsyncContextManager[None]:
        """Return the server, which serves while it is open."""
        raise NotImplementedError

    def connections(self, factory: Any) -> Any:
        """Return the factory of each connection's protocol, in place of the library's."""
        return factory

    def stop(self) -> None:
        """Close all connections, and the door."""
        if self._thread.is_alive():
            self._loop.call_soon_threadsafe(self._end.set)
        self._thread.join()

    def _run(self) -> None:
        asyncio.set_event_loop(self._loop)
        try:
            self._loop.run_until_complete(self._until_stopped())
        finally:
            self._ready.set()
            self._loop.close()

    async def _until_stopped(self) -> None:
        self._end = asyncio.Event()
        async with self.serving():
            self._ready.set()
            await self._end.wait()
            # asyncio leaves a connection that is taken, but not made, when a server is closed to the garbage collector
            self._loop.remove_reader(self._listener)
            for _ in range(_ROUNDS):
                await asyncio.sleep(0)
        for _ in range(_ROUNDS):
            await asyncio.sleep(0)
            rest = asyncio.all_tasks() - {asyncio.current_task()}
            for task in rest:
                task.cancel()
            await asyncio.gather(*rest, return_exceptions=True)
