"""Temperature, power and setpoint of a running loop from one scan, with the time of that scan.

Also the check whether a reading is plausible: a number within the sensor's range that moves when it should. Every
comparison states the good case, so a value that is not a number fails it.
"""

from __future__ import annotations

import math
import time
from collections import deque
from collections.abc import Mapping, Sequence
from typing import Final, NamedTuple

import numpy as np

from heatertune.errors import InputError, LinkDown
from heatertune.live.block_memory import BlockSignal
from heatertune.live.client.connection import Address, Client, ClosesOnExit, SignOfLife, connect, status_of_simulator
from heatertune.live.controller_block import Places
from heatertune.live.simulator_status import OWN, OWN_CELLS
from heatertune.model.model_values import HeaterModel

__all__ = ["Poller", "Snapshot", "StillSensor", "reading_problem"]


#: so long a reading may stand still after they have moved: the true dead time and lag may be longer than fitted
_DEAD_TIMES: Final = 1.0
_LAGS: Final = 0.25
_GAP_LAGS: Final = 0.1  # of the shortest lag: for so long nobody need know the power
_GAP_INTERVALS: Final = 4.0  # of the shortest interval between readings
_STEPS: Final = 5.0  # of the sensor that the heater has to have moved by


def reading_problem(degC: float, sensor_degC: tuple[float, float]) -> str:
    """Return why a temperature cannot be a reading, a few words; empty where it can.

    Args:
        degC: the temperature that the PLC shows [°C].
        sensor_degC: both ends of the sensor's range [°C]; the upper one is what a broken wire shows.
    """
    low, high = sensor_degC
    if not math.isfinite(degC):
        return "the reading is not a number"
    if not low <= degC < high:
        return f"the reading is {degC:.4g} °C, not within the sensor's range of {low:g} to {high:g} °C"
    return ""


class StillSensor:
    """Tells a frozen sensor from a loop at rest: the power has moved every plausible heater, but not its reading.

    Each heater is taken as one lag behind its dead time. How warm it is at first is not known: it is followed twice,
    from what the first power holds and from what the first reading says, and both have to have moved.
    """

    def __init__(self, heaters: Sequence[HeaterModel], least_degC: float) -> None:
        """Take heaters.

        Args:
            heaters: that are plausible.
            least_degC: by how much each of them has to have moved before a reading that stands still is frozen [°C].
        """
        self._gain = np.array([model.gain_degC_per_pct for model in heaters])
        self._lag_s = np.array([sum(model.lags_s) for model in heaters])
        self._dead_s = np.array([model.dead_time_s for model in heaters])
        self._ambient = np.array([float(model.ambient_degC or 0.0) for model in heaters])
        self._least_degC = least_degC
        self._patience_s = float((_DEAD_TIMES * self._dead_s + _LAGS * self._lag_s).max())
        self._step_degC = math.inf  # the smallest that was seen
        self._powers: deque[tuple[float, float]] = deque()
        self._held = np.empty((0, len(self._gain)))  # power that would hold each heater where it is [%]
        self._since = self._held
        self._reading, self._since_s, self._last_s = math.nan, 0.0, 0.0
        self._interval_s = math.inf  # the shortest between two readings
        self._moved_s = math.inf  # since when they have moved by as much

    def see(self, time_s: float, degC: float, power_pct: float) -> str:
        """Take a reading; return why it is frozen, a sentence; empty where it need not be.

        Args:
            time_s: of the reading [s].
            degC: that is shown [°C].
            power_pct: that the controller asks for; no number: it is not known [%]. Nor is it within a gap between
                two readings, after which the heaters are followed from the start.
        """
        passed_s = time_s - self._last_s
        gap = passed_s > max(_GAP_LAGS * float(self._lag_s.min()), _GAP_INTERVALS * self._interval_s)
        self._interval_s = min(self._interval_s, passed_s) if passed_s > 0.0 else self._interval_s
        if gap or not math.isfinite(power_pct) or not passed_s >= 0.0:
            self._held = np.empty((0, len(self._gain)))  # begins again with the next power
            self._powers.clear()
            self._reading, self._last_s = math.nan, time_s if math.isfinite(time_s) else 0.0
            return ""
        self._follow(time_s, degC, power_pct)
        if degC != self._reading:
            apart = abs(degC - self._reading)
            self._step_degC = apart if apart < self._step_degC else self._step_degC
            self._reading, self._since_s, self._since = degC, time_s, self._held.copy()
            self._moved_s = math.inf
            return ""
        moved = float(np.abs(self._gain * (self._held - self._since)).min())
        coarse = _STEPS * self._step_degC if math.isfinite(self._step_degC) else 0.0
        self._moved_s = min(self._moved_s, time_s) if moved > max(self._least_degC, coarse) else math.inf
        if not time_s - self._moved_s > self._patience_s:
            return ""
        return (f"the reading stands still at {degC:.4g} °C from {self._since_s:.6g} to {time_s:.6g} s, in which the "
                f"power has moved the heater by {moved:.2g} °C at least: the sensor is frozen")

    def _follow(self, time_s: float, degC: float, power_pct: float) -> None:
        if not len(self._held):
            by_reading = (degC - self._ambient) / self._gain
            self._held = np.array([np.full(len(self._gain), power_pct), by_reading])
        else:
            passed = 1.0 - np.exp(-(time_s - self._last_s) / self._lag_s)
            self._held += passed * (self._delayed(time_s) - self._held)
        self._powers.append((time_s, power_pct))
        oldest = time_s - float(self._dead_s.max())
        while len(self._powers) > 2 and self._powers[1][0] <= oldest:
            self._powers.popleft()
        self._last_s = time_s

    def _delayed(self, time_s: float) -> np.ndarray[tuple[int], np.dtype[np.float64]]:
        """Return the power that reaches each heater now [%]."""
        times, powers = (np.array(column) for column in zip(*self._powers, strict=True))
        place = np.searchsorted(times, time_s - self._dead_s, side="right") - 1
        return np.asarray(powers[np.maximum(place, 0)], dtype=float)


#: what the simulator's own block shows itself, where nobody says what stands in the controller's
_OWN_SIGNALS: Final = {"temperature": BlockSignal(OWN_CELLS["temperature_degC"][0], "LREAL"),
                       "power": BlockSignal(OWN_CELLS["power_pct"][0], "LREAL")}
_TURN: Final = 1 << 32


class Snapshot(NamedTuple):
    """What one scan left behind.

    Attributes:
        time_s: of the scan, by the PLC's own count where it has one, else by this machine's clock [s].
        seen: role, of `heatertune.live.controller_block.ROLES` → quantity.
        restarted: whether the PLC has begun to count anew since the look before.
    """

    time_s: float
    signals: Mapping[str, float]
    restarted: bool = False


class Poller(ClosesOnExit):
    """A connection that looks; `with` closes it. The time goes on over connections that are lost.

    Attributes:
        interval_s: time between two scans [s]; None: the PLC does not count them, and this machine's clock is used.
        torn: looks that two scans fell into, and that were left out.
        tells_new: whether a heartbeat or a source time shows that a look is new, where no scans are counted.
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
        if places is not None and places.topics:
            raise InputError(f"{places.summary}: names topics, and {address.text} is no broker: mqtt://HOST")
        self._address, self._timeout_s = address, timeout_s
        self.torn = 0
        self._life, self.tells_new = SignOfLife(), False
        self._begun = time.monotonic()
        self._count: int | None = None
        self._counted_at = self._begun
        self._time_s = 0.0
        self._client: Client = connect(address, timeout_s)
        try:
            own = status_of_simulator(self._client)
            self._places = places or Places(block=OWN, signals=_OWN_SIGNALS, summary="what the simulator tells")
            self._block = self._settled(own is not None, places)
        except BaseException:
            self.close()
            raise
        counter = self._places.counter
        self._counts_scans = own is not None
        self.interval_s = own.interval_s if own else counter.interval_s if counter else None

    @property
    def roles(self) -> Mapping[str, BlockSignal]:
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

    def read_signals(self, client: Client, number: int) -> tuple[dict[str, float], bytes]:
        """Return role → quantity as they are now, and the bytes that were read; errors as `Client.read`."""
        begin, count = self._places.span
        content = client.read(number, begin, count)
        return {role: signal.of(content, begin) for role, signal in self._places.signals.items()}, content

    def look(self) -> Snapshot | None:
        """Return what the latest scan left behind; None: nothing new, a CPU in STOP, or a scan fell into the look.

        Raises:
            LinkDown: a simulated PLC tells its scans no longer.
            LinkError: no answer; `again` connects anew.
        """
        before = status_of_simulator(self._client) if self._counts_scans else None
        if self._counts_scans and before is None:
            raise LinkDown(f"{self._address.text}: no longer tells its scans")
        if before is not None and before.shown in (0, self._count):
            return None
        start_s = time.monotonic()
        signals, content = self.read_signals(self._client, self._block)
        middle = 0.5 * (start_s + time.monotonic())
        if before is not None:
            after = status_of_simulator(self._client)
            whole = after is not None and after.shown == before.shown and (
                self._block != OWN or after.intervals == before.intervals == before.shown)
            if not whole:
                self.torn += self._block != OWN
                return None
            return self._looked(before.shown, _TURN, signals, first_s=(before.shown - 1) * before.interval_s)
        counter = self._places.counter
        if counter is None:
            return Snapshot(middle - self._begun, signals) if self._is_alive() else None
        scans = int(counter.signal.of(content, self._places.span[0])) % counter.turn
        return None if scans == self._count else self._looked(scans, counter.turn, signals, first_s=0.0)

    def _is_alive(self) -> bool:
        """Return whether what was read is of a CPU that runs, and new, as far as anything tells."""
        last, self._life = self._life, self._client.sign_of_life()
        self.tells_new = self._life.stamp is not None
        return self._life.runs is not False and self._life.is_new(last) is not False

    def _looked(self, scans: int, turn: int, values: Mapping[str, float], first_s: float) -> Snapshot:
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
        return Snapshot(self._time_s, values, restarted)

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
