"""A running loop, looked at from outside: temperature, power and setpoint of one scan, with the time of that scan."""

from __future__ import annotations

import time
from collections.abc import Mapping
from types import TracebackType
from typing import Final, NamedTuple, Self

from heatertune.errors import InputError, LinkDown
from heatertune.live.client.address import Address
from heatertune.live.client.client import Client, connect
from heatertune.live.client.simulator import told_by
from heatertune.live.memory import OWN, OWN_CELLS
from heatertune.live.signal_map import Places
from heatertune.live.word_codec import Signal

__all__ = ["Poller", "Snapshot"]

#: what the simulator's own block shows itself, where nobody says what stands in the controller's
_OWN_SIGNALS: Final = {"temperature": Signal(OWN_CELLS["temperature_degC"][0], "LREAL"),
                       "power": Signal(OWN_CELLS["power_pct"][0], "LREAL")}
_TURN: Final = 1 << 32


class Snapshot(NamedTuple):
    """What one scan left behind.

    Attributes:
        time_s: of the scan, by the PLC's own count where it has one, else by this machine's clock [s].
        seen: role, of `heatertune.live.signal_map.ROLES` → quantity.
        restarted: whether the PLC has begun to count anew since the look before.
    """

    time_s: float
    signals: Mapping[str, float]
    restarted: bool = False


class Poller:
    """A connection that looks; `with` closes it. The time goes on over connections that are lost.

    Attributes:
        interval_s: time between two scans [s]; None: the PLC does not count them, and this machine's clock is used.
        torn: looks that two scans fell into, and that were left out.
    """

    def __init__(self, address: Address, places: Places | None, timeout_s: float = 2.0) -> None:
        """Connect.

        Args:
            address: of the PLC.
            places: where it shows what; None: only a simulated PLC, which tells it itself, can be looked at.
            timeout_s: after which an answer is lost [s].

        Raises:
            InputError: no places, and the PLC is no simulator; no number of a block; places that one request does not
                reach, so that no look would be sure to be of one scan; the protocol's library is not installed.
            LinkError: nobody is there.
        """
        self._address, self._timeout_s = address, timeout_s
        self.torn = 0
        self._begun = time.monotonic()
        self._count: int | None = None
        self._counted_at = self._begun
        self._time_s = 0.0
        self._client: Client = connect(address, timeout_s)
        try:
            own = told_by(self._client)
            self._places = places or Places(block=OWN, signals=_OWN_SIGNALS, summary="what the simulator tells")
            self._block = self._settled(own is not None, places)
        except BaseException:
            self.close()
            raise
        counter = self._places.counter
        self._counts_scans = own is not None
        self.interval_s = own.interval_s if own else counter.interval_s if counter else None

    @property
    def roles(self) -> Mapping[str, Signal]:
        """What is seen, and where it stands."""
        return self._places.signals

    @property
    def whole(self) -> bool:
        """Whether a look is of one scan."""
        return self._client.whole

    def _settled(self, simulated: bool, places: Places | None) -> int:
        """Return the number of the block."""
        if places is None and not simulated:
            raise InputError(f"{self._address.text}: where does it show temperature and power? Say --design DIR (whose "
                             "controller runs there), or --map FILE.toml")
        block = self._places.block if places is None else self._address.block
        block = self._places.block if block is None else block
        if block is None:
            raise InputError(f"{self._address.text}: which block? End the address in /dbN, or say block = N in the map")
        if self._places.span[1] > self._client.most:
            raise InputError(f"{self._places.summary}: {self._places.span[1]} bytes from the first to the last that is "
                             f"looked at; one request reads {self._client.most}, and only that is of one scan")
        return block

    def look(self) -> Snapshot | None:
        """Return what the latest scan left behind; None: nothing new, or a scan fell into the look.

        Raises:
            LinkDown: a simulated PLC tells its scans no longer.
            LinkError: no answer; `again` connects anew.
        """
        begin, count = self._places.span
        before = told_by(self._client) if self._counts_scans else None
        if self._counts_scans and before is None:
            raise LinkDown(f"{self._address.text}: no longer tells its scans")
        if before is not None and before.shown in (0, self._count):
            return None
        asked = time.monotonic()
        content = self._client.read(self._block, begin, count)
        middle = 0.5 * (asked + time.monotonic())
        seen = {role: signal.of(content, begin) for role, signal in self._places.signals.items()}
        if before is not None:
            after = told_by(self._client)
            whole = after is not None and after.shown == before.shown and (
                self._block != OWN or after.intervals == before.intervals == before.shown)
            if not whole:
                self.torn += self._block != OWN
                return None
            return self._looked(before.shown, _TURN, seen, first_s=(before.shown - 1) * before.interval_s)
        counter = self._places.counter
        if counter is None:
            return Snapshot(middle - self._begun, seen)
        scans = int(counter.signal.of(content, begin)) % counter.turn
        return None if scans == self._count else self._looked(scans, counter.turn, seen, first_s=0.0)

    def _looked(self, scans: int, turn: int, seen: Mapping[str, float], first_s: float) -> Snapshot:
        assert self.interval_s is not None
        last, self._count = self._count, scans
        before, self._counted_at = self._counted_at, time.monotonic()
        passed = 0 if last is None else (scans - last) % turn
        restarted = passed > turn // 2  # backwards
        if not restarted:  # while nobody looked, it may have turned as often as this machine's clock says
            passed += turn * max(0, round(((self._counted_at - before) / self.interval_s - passed) / turn))
        if last is None:
            self._time_s = first_s
        else:
            self._time_s += self.interval_s * (1 if restarted else passed)
        return Snapshot(self._time_s, seen, restarted)

    def again(self) -> None:
        """Connect anew.

        Raises:
            LinkError: nobody is there.
        """
        self._client.close()
        self._client = connect(self._address, self._timeout_s)

    def close(self) -> None:
        """Close the connection."""
        self._client.close()

    def __enter__(self) -> Self:
        return self

    def __exit__(
        self, kind: type[BaseException] | None, problem: BaseException | None, trace: TracebackType | None
    ) -> None:
        self.close()
