"""A planned experiment on a running loop: it starts only if the loop is in the declared state, and always ends.

    checked → armed (previous mode and manual value saved on disk) → running → ended (both restored)

The plan, a limit, a sensor fault, a lost link, a key press, a machine that slept or an intervention from elsewhere ends
it, always with the same restoration. If the host dies, the PLC's own watchdog restores, and the next command for this
PLC finds the saved values: see `heatertune.live.hold`.

A plan says what is to be done, what ends it at once, and when enough is known.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import suppress
from dataclasses import dataclass, field
from functools import partial
from itertools import pairwise
from pathlib import Path
from threading import Thread
from typing import Final

from heatertune.errors import HeatertuneError, InputError, LinkError
from heatertune.live.client.connection import Address, Client, connect, status_of_simulator
from heatertune.live.controller_block import SERVED, ServedBlock, block_for, places_of
from heatertune.live.hold import Hold, WayBack, WayBackPart, is_number, new_way_back
from heatertune.live.poller import Snapshot, StillSensor
from heatertune.live.recorder import RecordingSetup, RecordingState, record
from heatertune.live.simulator_status import GUARDED, OWN, OWN_CELLS, RUNS
from heatertune.live.write.band import Reach, RiseWatch
from heatertune.live.write.plc_block import block_image
from heatertune.live.write.write_record import Budget
from heatertune.model.model_values import FittedModel
from heatertune.plc import Words, controller_for
from heatertune.plc.keyed_entry import value_texts
from heatertune.units import check
from heatertune.writing import read_text

__all__ = [
    "RATE_ROWS", "AbortLimits", "Aims", "Experiment", "ExperimentObserver", "ExperimentResult", "ManualMode",
    "RelaySchedule", "Steps", "read_plan", "restore",
]


_HEADS: Final = "time_s,power_pct"
_RELAY: Final = "rest_s,on_degC,off_degC,high_pct,low_pct,duration_s"
#: so many readings are looked at for the rate
RATE_ROWS: Final = 3
#: share of the sensor's range at its ends in which a reading is none
_EDGE: Final = 1e-3


@dataclass(frozen=True, slots=True, kw_only=True)
class AbortLimits:
    """What ends an experiment at once.

    Attributes:
        temperature_degC: none as high as this [°C].
        rate_degC_per_min: none faster, up or down, over three readings [°C/min]; None: any.
        silence_s: no new scan for so long by this machine's clock [s].

    Raises:
        OutOfRange: a number that is none.
    """

    temperature_degC: float
    rate_degC_per_min: float | None = None
    silence_s: float = 10.0

    def __post_init__(self) -> None:
        check("temperature_degC", self.temperature_degC)
        check("silence_s", self.silence_s, above=0.0)
        if self.rate_degC_per_min is not None:
            check("rate_degC_per_min", self.rate_degC_per_min, above=0.0)

    def broken(self, latest: Sequence[tuple[float, float]], sensor_degC: tuple[float, float]) -> tuple[str, str] | None:
        """Return the limit that the latest readings break, a word and a sentence; None: none.

        Args:
            latest: time [s] and reading [°C] of each, the latest last.
            sensor_degC: both ends of the sensor's range [°C].
        """
        low, high = sensor_degC
        edge, (now_s, degC), (first_s, first) = _EDGE * (high - low), latest[-1], latest[0]
        if not low + edge < degC < high - edge:
            return "sensor", (
                f"the reading is {degC:.2f} °C, an end of its range {low:g}…{high:g} °C: is the sensor there?")
        if not degC < self.temperature_degC:
            return "limit", f"{degC:.2f} °C: the limit is {self.temperature_degC:g} °C"
        if self.rate_degC_per_min is not None and len(latest) == RATE_ROWS and now_s > first_s:
            rate = 60.0 * (degC - first) / (now_s - first_s)
            if not abs(rate) <= self.rate_degC_per_min:
                return "rate", f"{rate:.3g} °C/min: the limit is {self.rate_degC_per_min:g} °C/min"
        return None


@dataclass(frozen=True, slots=True, kw_only=True)
class Aims:
    """When enough is known.

    Attributes:
        shares: field of the model → half of its 95 % interval over its value, at most; none: the plan decides.
        every_rows: a fit after so many more rows.
    """

    shares: Mapping[str, float] = field(default_factory=dict)
    every_rows: int = 40

    def reached(self, fitted: FittedModel) -> bool:
        """Return whether each interval is as narrow as asked; one that is open or unknown is not."""
        for name, share in self.shares.items():
            interval = fitted.ci95.get(name)
            if interval is None or interval.low is None or interval.high is None:
                return False
            if interval.high - interval.low > 2.0 * share * abs(getattr(fitted.model, name)):
                return False
        return True


@dataclass(frozen=True, slots=True, kw_only=True)
class Steps:
    """A plan of powers at instants.

    Attributes:
        steps: instants [s] and powers [%], the first at 0 s; the last is held as long as the longest before it.
    """

    steps: tuple[tuple[float, float], ...]

    @property
    def powers(self) -> set[float]:
        """All its powers [%]."""
        return {power for _, power in self.steps}

    @property
    def ends_s(self) -> float:
        """After so long it is over [s]."""
        return self.steps[-1][0] + max(after - before for (before, _), (after, _) in pairwise(self.steps))

    def power(self, after_s: float, _degC: float, _last: float | None) -> float:
        """Return the power after so long [%]."""
        return next(power for at, power in reversed(self.steps) if at <= after_s)


@dataclass(frozen=True, slots=True, kw_only=True)
class RelaySchedule:
    """A plan that switches by the reading.

    Attributes:
        rest_s: at the low power first [s].
        on_degC, off_degC: down to one the high power comes, up to the other it goes [°C].
        high_pct, low_pct: the powers [%].
        duration_s: after so long it is over [s].

    Raises:
        OutOfRange: a number that is none, both powers or both temperatures the wrong way round.
    """

    rest_s: float
    on_degC: float
    off_degC: float
    high_pct: float
    low_pct: float
    duration_s: float

    def __post_init__(self) -> None:
        check("rest_s", self.rest_s, least=0.0)
        check("duration_s", self.duration_s, above=self.rest_s)
        check("low_pct", self.low_pct, least=0.0, most=100.0)
        check("high_pct", self.high_pct, above=self.low_pct, most=100.0)
        check("on_degC", self.on_degC)
        check("off_degC", self.off_degC, above=self.on_degC)

    @property
    def powers(self) -> set[float]:
        """Both powers [%]."""
        return {self.high_pct, self.low_pct}

    @property
    def ends_s(self) -> float:
        """After so long it is over [s]."""
        return self.duration_s

    def power(self, after_s: float, degC: float, last: float | None) -> float:
        """Return the power after so long, at a reading, where it was another or none before [%]."""
        if after_s < self.rest_s:
            return self.low_pct
        if self.on_degC < degC < self.off_degC and last is not None and after_s > self.rest_s:
            return last if last == self.high_pct else self.low_pct
        return self.high_pct if degC <= self.on_degC else self.low_pct


def read_plan(path: str | Path) -> Steps | RelaySchedule:
    """Return a plan as `heatertune plan -o` writes it: powers at instants, or a relay's settings.

    Raises:
        InputError: it cannot be read, or a line is none of a plan; the message names it.
        OutOfRange: a number of a relay that cannot be.
    """
    try:
        lines = read_text(path).splitlines()
    except OSError as problem:
        raise InputError(f"{path}: cannot be read: {problem.strerror}") from None
    except UnicodeDecodeError:
        raise InputError(f"{path}: no text; expected {_HEADS}") from None
    head = lines[0].strip() if lines else ""
    rest = [(number, line) for number, line in enumerate(lines[1:], start=2) if line.strip()]
    if head == _RELAY:
        number, line = rest[0] if rest else (2, "")
        values = _numbers(f"{path}, line {number}", line, _RELAY.split(","))
        return RelaySchedule(**dict(zip(_RELAY.split(","), values, strict=True)))
    if head != _HEADS:
        raise InputError(f"{path}, line 1: {head!r}; expected {_HEADS}, or {_RELAY}")
    steps = list[tuple[float, float]]()
    for number, line in rest:
        steps.append(_step(f"{path}, line {number}", line, steps))
    if len(steps) < 2:
        raise InputError(f"{path}: {len(steps)} steps; expected the power at 0 s and one step at least")
    return Steps(steps=tuple(steps))


def _numbers(place: str, line: str, names: Sequence[str]) -> list[float]:
    try:
        numbers = [float(cell) for cell in line.split(",")]
    except ValueError:
        numbers = []
    if len(numbers) != len(names) or not all(map(math.isfinite, numbers)):
        raise InputError(f"{place}: {line.strip()!r}; expected {len(names)} numbers: {', '.join(names)}")
    return numbers


def _step(place: str, line: str, before: Sequence[tuple[float, float]]) -> tuple[float, float]:
    at, power = _numbers(place, line, _HEADS.split(","))
    if not 0.0 <= power <= 100.0:
        raise InputError(f"{place}: power {power:g}; expected 0…100 %")
    if not (before[-1][0] < at if before else at == 0.0):
        raise InputError(f"{place}: {at:g} s; expected {'more than in the line above' if before else '0 s first'}")
    return at, power


class ManualMode:
    """The cells of a block that put the controller in manual, with a power; they are written in one request.

    Attributes:
        address: of the PLC.
        block: of the controller, as heatertune knows it.
        place: number of the block, first byte of the cells, and how many they are.
        real: byte of the cells at which the power begins, a REAL; None: it is a whole number.
    """

    def __init__(self, address: Address, words: Words, timeout_s: float) -> None:
        """Prepare; nothing is asked of the PLC yet.

        Args:
            address: of the PLC.
            words: that it is said to hold.
            timeout_s: after which an answer is lost [s].

        Raises:
            InputError: the controller's block is not known, or has no manual mode.
        """
        if words.target not in SERVED:
            raise InputError(f"the block of {words.target} is not known: set the powers manually, and record")
        self.address, self._timeout_s = address, timeout_s
        self.block: ServedBlock = block_for(controller_for(words.target), words, {})
        self._image = self.block.image()
        start, put = self.block.put_in_manual(self._image, 0.0)
        block_number = address.block if address.protocol == "s7" else None
        self.place = self.block.number if block_number is None else block_number, start, len(put)
        at = self.block.put_in_manual(self._image, _PROBE_PCT)[1].find(struct.pack(">f", _PROBE_PCT))
        self.real = None if at < 0 else at

    def open_client(self) -> Client:
        """Return a new connection; errors as `heatertune.live.client.connection.connect`."""
        return connect(self.address, self._timeout_s)

    def image(self, client: Client) -> bytes:
        """Return the whole block; errors as `Client.read`."""
        return client.read(self.place[0], 0, len(self._image))

    def cells(self, client: Client) -> bytes:
        """Return the content of the cells; errors as `Client.read`."""
        return client.read(*self.place)

    def write_cells(self, client: Client, content: bytes) -> None:
        """Write the cells; errors as `Client.write`."""
        client.write(self.place[0], self.place[1], content)

    def by_hand(self, before: bytes, power_pct: float) -> bytes:
        """Return the cells in manual with a power, all else in them as before."""
        return self.block.put_in_manual(bytes(self._with(before)), power_pct)[1]

    def after_dead_man(self, put: bytes) -> bytes:
        """Return the cells as the PLC's dead man leaves them behind a put."""
        image = self._with(put)
        self.block.into_automatic(image)
        _, start, count = self.place
        return bytes(image[start : start + count])

    def _with(self, cells: bytes) -> bytearray:
        image = bytearray(self._image)
        _, start, count = self.place
        image[start : start + count] = cells
        return image


_SAME_PCT: Final = 1e-6
#: a power whose bytes show where the cells hold it
_PROBE_PCT: Final = 25.0
#: as what a change of mode and power is counted
_MANUAL: Final = "manual"
#: so long nobody may look [s], however busy the machine is
_ASLEEP_S: Final = 10.0
#: by how much every plausible heater must have moved before a reading that stands still is frozen
_FROZEN_DEGC: Final = 3.0


@dataclass(slots=True, kw_only=True)
class ExperimentResult:
    """How an experiment ended.

    Attributes:
        why: one of `plan`, `known`, `limit`, `rate`, `sensor`, `link`, `silence`, `hand`, `key`, `output`.
        told: the same as a sentence.
        restored: whether what stood there before is known to stand there again; None: it is not known.
        recorded: the log's figures.
        fitted: the heater, where a fit beside the looks succeeded.
        power_pct: the latest power that was sent [%]; None: none was.
    """

    reason: str
    message: str
    restored: bool | None = None
    recording: RecordingState | None = None
    fitted_model: FittedModel | None = None
    power_pct: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class ExperimentObserver:
    """Who watches an experiment.

    Attributes:
        shown: called after each look, with what is recorded and what the hand does.
        key: asked after each look whether somebody wants the end.
        fit: log → heater, for the aims; None: the plan is run to its end.
        progress: called with a sentence where bringing back what stood there takes long.
        enough: asked meanwhile whether somebody wants to wait no longer.
    """

    on_row: Callable[[RecordingState, str], object] = lambda *_: None
    key: Callable[[], bool] = lambda: False
    fit: Callable[[Path], FittedModel] | None = None
    progress: Callable[[str], object] = str
    enough: Callable[[], bool] = lambda: False


class Experiment:
    """One experiment: `check`, then `run`.

    Attributes:
        plan: what it does.
        limits: what ends it at once.
        mode: mode and manual value of the controller.
        sensor_degC: both ends of the sensor's range [°C].
        has_dead_man: whether `check` has found one.
        budget: that counts what is written there.
        hold: on the PLC, and the clock.
        timeout_s: after which an answer is lost [s].
        reach: of the plausible heaters; None: neither a frozen sensor nor a rise that is too fast is told.
    """

    def __init__(self, plan: Steps | RelaySchedule, address: Address, words: Words, limits: AbortLimits, *,
                 timeout_s: float = 1.0, pwm_period_s: float | None = None, in_manual: bool = False,
                 reach: Reach | None = None) -> None:
        """Prepare; nothing is asked of the PLC yet.

        Args:
            plan: what it does.
            address: of the PLC.
            words: that it is said to hold.
            limits: what ends it at once.
            timeout_s: after which an answer is lost [s].
            pwm_period_s: of the heater's switch, for the log; None where nobody knows [s].
            in_manual: whether the controller is in manual before, and is to be so afterwards.
            reach: of the plausible heaters, to tell a frozen sensor and a rise that none of them makes; None: neither
                is told.

        Raises:
            InputError: the controller's block is not known, or has no manual mode; a power of the plan is more than
                the words' largest output.
        """
        _demand_proven_power(plan, words)
        self.reach = reach
        self.mode, self._standing = ManualMode(address, words, timeout_s), block_image(words, address, {})
        self.plan, self._words, self.limits = plan, words, limits
        self._recording = RecordingSetup(timeout_s=timeout_s, pwm_period_s=pwm_period_s)
        self.sensor_degC, self.has_dead_man = words.scaling.sensor_degC, False
        self._in_manual, self.hold, self.timeout_s = in_manual, Hold(address), timeout_s
        self.budget = Budget(address, self.mode.place[0])

    def check(self) -> tuple[str, ...]:
        """Return the findings, one sentence each.

        Raises:
            InputError: another block, other words, a temperature beyond the limit or the sensor's range, a CPU in STOP;
                a controller in manual, unless it is said to be; another command on this PLC, or an experiment on it
                that has not ended.
            LinkError: nobody is there.
        """
        where = self.mode.address.text
        with self.hold.lock("experiment"):
            self.hold.demand_free()
        with self.mode.open_client() as client:
            self._demand_words(client)
            image, own = self.mode.image(client), status_of_simulator(client)
        self._demand_mode(image)
        if own is not None and not own.status & RUNS:
            raise InputError(f"{where}: the CPU is in STOP")
        degC = self.mode.block.signals["temperature"].of(image)
        broken = self.limits.broken([(0.0, degC)], self.sensor_degC)
        if broken is not None:
            raise InputError(f"{where}: {broken[1]}")
        self.has_dead_man = own is not None and bool(own.status & GUARDED)
        mode = "manual" if self.mode.block.in_manual(image) else "automatic"
        dead_man = "dead man: the simulator's, by its heartbeat" if self.has_dead_man else "no dead man is known here"
        return (f"the block holds the words of {self._words.target}", f"{mode}, {degC:.2f} °C", dead_man,
                *self._limits_found())

    def _limits_found(self) -> Iterator[str]:
        """Yield at which rise it stops, and how often manual was written from here."""
        if self.reach is not None:
            yield (f"stops where the temperature rises by more than {60.0 * self.reach.rate_degC_per_s:.3g} °C/min, "
                   "twice as fast as the fastest plausible heater at full power")
        if wrote := self.budget.counts()[_MANUAL]:
            yield f"manual was written {wrote} times from here before"

    def _demand_mode(self, image: bytes) -> None:
        """Refuse a mode that nobody has said: an experiment from elsewhere may have left it."""
        manual = self.mode.block.in_manual(image)
        if manual and not self._in_manual:
            raise InputError(f"{self.mode.address.text}: the controller is in manual already, and the experiment would "
                             "leave it so: put it in automatic; or, where manual at its present value is what you "
                             "want afterwards, say --in-manual")
        if self._in_manual and not manual:
            raise InputError(f"{self.mode.address.text}: the controller is in automatic, not in manual as said")

    def _demand_words(self, client: Client) -> None:
        there = self._standing
        content = there.read(client)
        values = {**{name: value for name, value in there.values(content).items() if name in there.own},
                  **there.bits(content)}
        there_texts, texts = value_texts(self._words, values), value_texts(self._words, self._words.values)
        other = [f"{name} = {there_texts[name]}, not {texts[name]}" for name, value in values.items()
                 if name not in there.block.operators and value != self._words.values[name]]
        if other:
            raise InputError(f"{self.mode.address.text} holds other words: {', '.join(other[:3])}; give the folder of "
                             "the controller that runs there")

    def run(self, log: str | Path, aims: Aims | None = None,
            watching: ExperimentObserver | None = None) -> ExperimentResult:
        """Run it; the log is written as `heatertune.live.recorder.record` writes one.

        Args:
            log: to write.
            aims: when enough is known; None: at the plan's end.
            watching: who watches.

        Raises:
            InputError: there is a log already; as `check`; the state folder or the log cannot be written.
            LinkError: nobody is there at the beginning; nothing has been changed.
        """
        if Path(log).exists():
            raise InputError(f"{log}: is there already; take another name")
        with self.hold.lock("experiment"):
            self.hold.demand_free()
            with self.mode.open_client() as client:
                image = self.mode.image(client)
            self._demand_mode(image)
            _, start, count = self.mode.place
            before = image[start : start + count]
            self.hold.open(self._way_back(before, log))
            hand = _Hand(self, before, Path(log), aims or Aims(), watching or ExperimentObserver())
            restored = None
            try:
                recorded = self._recorded(hand, log)
            finally:
                restored = hand.give_back()
                hand.join()
        assert hand.ended is not None
        hand.ended.restored, hand.ended.recording, hand.ended.fitted_model = restored, recorded, hand.fitted
        hand.ended.power_pct = hand.sent_pct
        return hand.ended

    def _recorded(self, hand: _Hand, log: str | Path) -> RecordingState:
        """Record, with the hand on the controller, until that has ended; raise what stops it before the first put."""
        try:
            return record(self.mode.address, log, places_of(self._words), self._recording,
                          shown=hand.looked, ended=lambda: hand.ended is not None)
        except (HeatertuneError, OSError) as problem:  # a disk that is full, a terminal that is gone
            if hand.sent_pct is None:
                raise
            hand.end("output", str(problem))
            return hand.so_far

    def _way_back(self, before: bytes, log: str | Path) -> WayBack:
        number, start, _ = self.mode.place
        puts = {self.mode.by_hand(before, power) for power in self.plan.powers}
        part = WayBackPart(start, before, puts | set(map(self.mode.after_dead_man, puts)), self.mode.real)
        return new_way_back("experiment", self.mode.address, number, [part], log, max(self.plan.powers))


class _Hand:
    """The hand on the controller while the recorder looks; it has a connection of its own."""

    def __init__(self, whole: Experiment, before: bytes, log: Path, aims: Aims, watching: ExperimentObserver) -> None:
        self._whole, self._before, self._log, self._aims, self._watching = whole, before, log, aims, watching
        self._client: Client | None = None
        self._put, self._hold = before, whole.hold
        self._power: float | None = None
        self.sent_pct: float | None = None
        self.so_far = RecordingState()
        self._rows = self._fitted_at = self._beats = 0
        self._first_s: float | None = None
        self._latest = list[tuple[float, float]]()
        self._new_at = self._looked_at = whole.hold.clock.now_s()
        self._still = None if whole.reach is None else StillSensor(whole.reach.heaters, _FROZEN_DEGC)
        self._rise = None if whole.reach is None else RiseWatch(whole.reach)
        self._fitting: Thread | None = None
        self.ended: ExperimentResult | None = None
        self.fitted: FittedModel | None = None

    def looked(self, so_far: RecordingState) -> None:
        """Act on a look: end it, or go on by the plan."""
        self.so_far = so_far
        if self.ended is None:
            try:
                self._act(so_far)
            except LinkError as problem:
                self.end("link", str(problem))
        self._watching.on_row(so_far, "" if self._power is None else f"{self._power:g} % in manual")

    def end(self, why: str, message: str) -> None:
        """End it; `why` as in `Ended`."""
        self.ended = ExperimentResult(reason=why, message=message)

    def _act(self, so_far: RecordingState) -> None:
        now_s = self._whole.hold.clock.now_s()
        away_s, self._looked_at = now_s - self._looked_at, now_s
        if not away_s <= max(_ASLEEP_S, self._whole.limits.silence_s):
            self.end("silence", f"nobody looked for {away_s:.0f} s: this machine was asleep, or the program stopped")
        elif so_far.trouble:
            self.end("link", so_far.trouble)
        elif so_far.notes:
            self.end("output", so_far.notes[-1])
        elif self._watching.key():
            self.end("key", "someone requested the end")
        elif so_far.rows == self._rows or so_far.last is None:
            silent_s = now_s - self._new_at
            if not silent_s <= self._whole.limits.silence_s:
                self.end("silence", f"no new scan for {silent_s:.0f} s: is the CPU in STOP?")
        else:
            self._rows, self._new_at = so_far.rows, now_s
            self._new(so_far.last)
        if self.ended is None and self._whole.has_dead_man:
            self._beats = (self._beats + 1) % 65536
            self._connection().write(OWN, OWN_CELLS["heartbeat"][0], self._beats.to_bytes(2, "big"))

    def _new(self, look: Snapshot) -> None:
        """Act on a new reading."""
        self._first_s = look.time_s if self._first_s is None else self._first_s
        after_s, degC = look.time_s - self._first_s, look.signals["temperature"]
        self._latest = [*self._latest[1 - RATE_ROWS :], (look.time_s, degC)]
        broken = self._whole.limits.broken(self._latest, self._whole.sensor_degC)
        if broken is not None:
            self.end(*broken)
        elif rise := "" if self._rise is None else self._rise.see(look.time_s, degC):
            self.end("rate", rise)
        elif frozen := self._frozen(after_s, degC):
            self.end("sensor", frozen)
        elif look.restarted:
            self.end("silence", "the PLC has restarted")
        elif after_s >= self._whole.plan.ends_s:
            self.end("plan", "the plan is over")
        else:
            self._set(self._whole.plan.power(after_s, degC, self._power))
            self._fit_beside()

    def _frozen(self, after_s: float, degC: float) -> str:
        """Return why the sensor is frozen, a sentence; empty where it need not be, or no heater is known."""
        if self._still is None or self._power is None:
            return ""
        return self._still.see(after_s, degC, self._power)

    def _connection(self) -> Client:
        if self._client is None:
            self._client = self._whole.mode.open_client()
        return self._client

    def _set(self, power: float) -> None:
        """Put a power, where what stands there is what was put before; nobody else's change is undone."""
        mode, client = self._whole.mode, self._connection()
        if (cells := mode.cells(client)) != self._put:
            self.end("hand", "somebody else has changed the mode or the manual value, or the PLC's dead man has"
                     if is_number(cells, mode.real) else "the manual value in the PLC is not a number")
        elif power != self._power:
            before, self._put = self._put, mode.by_hand(self._before, power)
            self._send(client, power, before)
            self._power = power

    def _send(self, client: Client, power: float, before: bytes) -> None:
        """Send a put, and see that it stands there; until then the way back on the disk says that it may arrive."""
        mode = self._whole.mode
        try:
            self._whole.budget.count((_MANUAL,))
            self._hold.note_request()
        except InputError as problem:
            self.end("output", str(problem))
            return
        self.sent_pct = power
        self._hold.send(partial(mode.write_cells, client, self._put))
        cells = mode.cells(client)
        if cells == self._put:
            self._hold.note_stored()
        elif cells == before:
            self.end("hand", f"{power:g} % was accepted, but does not stand there")
        else:
            self._hold.add_own(mode.place[1], cells)
            self._hold.note_stored()
            self.end("hand", f"the device keeps other values than were written for {power:g} %: a limit of its own, or "
                             "somebody else has changed them just now")

    def _fit_beside(self) -> None:
        """Begin a fit of what there is, beside the looks; end where it knows enough."""
        fit = self._watching.fit
        if fit is None or not self._aims.shares or (self._fitting is not None and self._fitting.is_alive()):
            return
        if self.fitted is not None and self._aims.reached(self.fitted):
            self.end("known", "the requested accuracy is reached")
        elif self._rows >= self._fitted_at + self._aims.every_rows:
            self._fitted_at = self._rows
            self._fitting = Thread(target=self._fit, args=(fit,), name="fit", daemon=True)
            self._fitting.start()

    def _fit(self, fit: Callable[[Path], FittedModel]) -> None:
        with suppress(HeatertuneError):  # too little yet: the next one has more
            self.fitted = fit(self._log)

    def give_back(self) -> bool | None:
        """Bring back what stood there; as `heatertune.live.hold.Hold.bring_back`."""
        if self._client is not None:
            self._client.close()
        if self.sent_pct is None:
            self._hold.close()
            return True
        return self._hold.bring_back(self._whole.timeout_s, self._watching.progress, self._watching.enough)

    def join(self) -> None:
        """Wait for a fit that is under way: the controller has been given back by then."""
        if self._fitting is not None:
            self._fitting.join()


def _demand_proven_power(plan: Steps | RelaySchedule, words: Words) -> None:
    """Refuse a plan with more power than the words ever ask for: nothing was proven of it."""
    largest = controller_for(words.target).most_power_pct(words)
    highest = max(plan.powers)
    if not highest <= largest + _SAME_PCT:
        raise InputError(f"the plan goes to {highest:g} %, and the words that were proven never ask for more than "
                         f"{largest:.4g} %: plan again with --power 0 {math.floor(largest):g}")


def restore(address: Address, timeout_s: float = 1.0, progress: Callable[[str], object] = str) -> bool | None:
    """Finish the way back of a command whose program died.

    Args:
        address: of the PLC.
        timeout_s: after which an answer is lost [s].
        progress: called with a sentence where it takes long.

    Returns:
        As `heatertune.live.hold.Hold.bring_back`.

    Raises:
        DocumentError: the way back is damaged.
        InputError: there is none, the command still runs, or the record of a write says more: the message names it.
    """
    hold = Hold(address)
    with hold.lock("experiment --restore"):
        way_back = hold.way_back()
        if way_back is None:
            raise InputError(f"{address.text}: no experiment from here is open on this PLC: nothing to bring back")
        if "--restore" not in way_back.remedy:
            raise InputError(way_back.message)
        hold.resume()
        return hold.bring_back(timeout_s, progress)
