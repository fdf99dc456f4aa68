"""One block of one PLC over a link that may fail: what is read may be asked for again, what is written goes once."""

from __future__ import annotations

import time
from collections.abc import Mapping
from dataclasses import dataclass
from types import TracebackType
from typing import Any, Final, Self

from heatertune.errors import LinkDown, LinkError, PlcRefused, ReplyLost
from heatertune.live.client.address import Address
from heatertune.live.client.client import Client, connect
from heatertune.live.client.simulator import told_by
from heatertune.live.memory import RUNS, SimulatorStatus
from heatertune.live.write.block_image import BlockImage, WritePart
from heatertune.plc.ramp import Number

__all__ = ["BlockSnapshot", "LinkSettings", "Peer", "runs"]

_SOON_S: Final = 0.002  # between two looks at a simulator, whose time may go fast
_LEAST_WAIT_S: Final = 5.0


@dataclass(frozen=True, slots=True, kw_only=True)
class LinkSettings:
    """How a link is held.

    Attributes:
        tries: connections that are tried, one after the other, where one is lost.
        pause_s: before each but the first [s].
        timeout_s: after which an answer is lost [s].
    """

    tries: int = 5
    pause_s: float = 1.0
    timeout_s: float = 2.0


@dataclass(frozen=True, slots=True)
class BlockSnapshot:
    """What was seen in one moment.

    Attributes:
        content: bytes of the block, from the first that holds a word to the last.
        values: the words in them.
        told: the simulator's own block; None: this is none.
        time_s: of the plant where the simulator tells it, else of this machine [s].
    """

    content: bytes
    values: Mapping[str, Number]
    status: SimulatorStatus | None
    time_s: float

    def to_document(self) -> dict[str, Any]:
        """Return it as a record has it."""
        scan = {} if self.status is None else {"scan": self.status.scans, "plc_s": self.time_s}
        return {**scan, "bytes": self.content.hex()}


class Peer:
    """A PLC; it is connected to when it is first asked."""

    def __init__(self, address: Address, standing: BlockImage, interval_s: float,
                 link: LinkSettings | None = None) -> None:
        """Take an address.

        Args:
            address: of the PLC.
            standing: what is there.
            interval_s: time between two scans [s].
            link: how the link is held.
        """
        self.address, self.standing, self._interval_s = address, standing, interval_s
        self._link, self._client = link or LinkSettings(), None
        self._simulated: bool | None = None

    _client: Client | None

    def look(self) -> BlockSnapshot:
        """Return what stands there; a lost connection is made anew, as often as `Link` allows.

        Raises:
            LinkError: no connection, or the PLC says that there is no such block.
        """
        for number in range(self._link.tries):
            if number:
                time.sleep(self._link.pause_s)
            try:
                return self._look()
            except PlcRefused:
                raise
            except LinkError as problem:
                self.close()
                last = problem
        raise last

    def _look(self) -> BlockSnapshot:
        client, at = self._connected(), self.standing
        content = at.read(client)
        told = self._told(client)
        seen = time.monotonic() if told is None else told.intervals * told.interval_s
        return BlockSnapshot(content, at.values(content), told, seen)

    def _told(self, client: Client) -> SimulatorStatus | None:
        if self._simulated is False:
            return None
        told = told_by(client)
        self._simulated = told is not None
        return told

    def _connected(self) -> Client:
        if self._client is None:
            self._client = connect(self.address, self._link.timeout_s)
        return self._client

    def write(self, part: WritePart, content: bytes) -> None:
        """Write a part's bytes, once.

        Raises:
            PlcRefused, LinkDown: they were not written.
            ReplyLost: whether they were is not known.
        """
        try:
            self._connected().write(self.standing.number, part.start, content)
        except (LinkDown, ReplyLost):
            self.close()
            raise

    def later(self, since: BlockSnapshot, scans: int) -> BlockSnapshot:
        """Return what stands there so many scans later, or, where none pass, in STOP at once, else after a while.

        Raises:
            LinkError: as `look`.
        """
        if since.status is None:
            time.sleep(scans * self._interval_s)
            return self.look()
        ends = time.monotonic() + max(_LEAST_WAIT_S, 2.0 * scans * self._interval_s)
        while True:
            look = self.look()
            if look.status is None or look.status.scans - since.status.scans >= scans or not runs(look):
                return look
            if time.monotonic() > ends:
                return look
            time.sleep(_SOON_S)

    def pause(self) -> None:
        """Wait until the next look is worth its while."""
        time.sleep(_SOON_S if self._simulated else 0.5 * self._interval_s)

    def close(self) -> None:
        """Close the connection, if there is one."""
        if self._client is not None:
            self._client.close()
            self._client = None

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, problem: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()


def runs(look: BlockSnapshot) -> bool | None:
    """Return whether the CPU runs, None where nobody tells."""
    return None if look.status is None else bool(look.status.status & RUNS)
