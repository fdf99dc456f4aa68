"""A planned experiment on a running loop: it arms only where all is as it was said, and always ends.

    checked → armed (what stood there is on the disk) → running → ended: what stood there stands there again

Whatever ends it (the plan, a limit, a sensor, the link, somebody's key, somebody else's hand) is followed by the same
way back. Where the host dies, the PLC's own dead man does it, and the next start finds the file and finishes the way.
"""

from __future__ import annotations

import json
import math
import time
from collections.abc import Callable, Sequence
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from threading import Thread
from typing import Any, Final

from heatertune.documents import read_document
from heatertune.errors import DocumentError, HeatertuneError, InputError, LinkError
from heatertune.live.change.cells import standing
from heatertune.live.client.address import Address, address_of
from heatertune.live.client.client import Client
from heatertune.live.client.simulator import told_by
from heatertune.live.looking import Look
from heatertune.live.manual import ManualMode
from heatertune.live.memory import GUARDED, OWN, OWN_CELLS, RUNS
from heatertune.live.places import places_of
from heatertune.live.readings import StillSensor
from heatertune.live.recorder import Recorded, Recording, record
from heatertune.live.schedule import RATE_ROWS, Aims, Limits, Relay, Steps
from heatertune.model.values import FittedModel, HeaterModel
from heatertune.plc import Words, controller_for
from heatertune.writing import write_files

__all__ = ["BEFORE_SCHEMA", "Ended", "Experiment", "Watching", "before_of", "restore"]

BEFORE_SCHEMA: Final = "heatertune/experiment-before/1"
_SAME_PCT: Final = 1e-6
#: by how much every plausible heater must have moved before a reading that stands still is frozen
_FROZEN_DEGC: Final = 3.0


@dataclass(slots=True, kw_only=True)
class Ended:
    """How an experiment ended.

    Attributes:
        why: one of `plan`, `known`, `limit`, `rate`, `sensor`, `link`, `silence`, `hand`, `key`.
        told: the same as a sentence.
        restored: whether what stood there before is known to stand there again; None: it is not known.
        recorded: the log's figures.
        fitted: the heater, where a fit beside the looks succeeded.
    """

    why: str
    told: str
    restored: bool | None = None
    recorded: Recorded | None = None
    fitted: FittedModel | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Watching:
    """Who watches an experiment.

    Attributes:
        shown: called after each look, with what is recorded and what the hand does.
        key: asked after each look whether somebody wants the end.
        fit: log → heater, for the aims; None: the plan is run to its end.
    """

    shown: Callable[[Recorded, str], object] = lambda *_: None
    key: Callable[[], bool] = lambda: False
    fit: Callable[[Path], FittedModel] | None = None


def before_of(log: str | Path) -> Path:
    """Return the file beside a log that holds what stood in the PLC before."""
    return Path(f"{log}.before.json")


class Experiment:
    """One experiment: `check`, then `run`.

    Attributes:
        plan: what it does.
        limits: what ends it at once.
        mode: mode and manual value of the controller.
        sensor_degC: both ends of the sensor's range [°C].
        has_dead_man: whether `check` has found one.
        heaters: that are plausible; none: a frozen sensor is not told.
    """

    def __init__(self, plan: Steps | Relay, address: Address, words: Words, limits: Limits, *,
                 timeout_s: float = 1.0, pwm_period_s: float | None = None,
                 heaters: Sequence[HeaterModel] = ()) -> None:
        """Prepare; nothing is asked of the PLC yet.

        Args:
            plan: what it does.
            address: of the PLC.
            words: that it is said to hold.
            limits: what ends it at once.
            timeout_s: after which an answer is lost [s].
            pwm_period_s: of the heater's switch, for the log; None where nobody knows [s].
            heaters: that are plausible, to tell a frozen sensor; none: it is not told.

        Raises:
            InputError: the controller's block is not known, or has no manual mode; a power of the plan is more than
                the words' largest output.
        """
        _demand_proven_power(plan, words)
        self.heaters = tuple(heaters)
        self.mode, self._standing = ManualMode(address, words, timeout_s), standing(words, address, {})
        self.plan, self._words, self.limits = plan, words, limits
        self._recording = Recording(timeout_s=timeout_s, pwm_period_s=pwm_period_s)
        self.sensor_degC, self.has_dead_man = words.scaling.sensor_degC, False

    def check(self) -> tuple[str, ...]:
        """Return what was found, one sentence each.

        Raises:
            InputError: another block, other words, a temperature beyond the limit or the sensor's range, a CPU in STOP.
            LinkError: nobody is there.
        """
        where = self.mode.address.text
        with self.mode.connected() as client:
            self._demand_words(client)
            image, own = self.mode.image(client), told_by(client)
        if own is not None and not own.status & RUNS:
            raise InputError(f"{where}: the CPU is in STOP")
        degC = self.mode.block.signals["temperature"].of(image)
        broken = self.limits.broken([(0.0, degC)], self.sensor_degC)
        if broken is not None:
            raise InputError(f"{where}: {broken[1]}")
        self.has_dead_man = own is not None and bool(own.status & GUARDED)
        mode = "manual" if self.mode.block.in_manual(image) else "automatic"
        dead_man = "dead man: the simulator's, by its heartbeat" if self.has_dead_man else "no dead man is known here"
        return f"the block holds the words of {self._words.target}", f"{mode}, {degC:.2f} °C", dead_man

    def _demand_words(self, client: Client) -> None:
        there = self._standing
        content = there.read(client)
        found = {**{name: value for name, value in there.values(content).items() if name in there.own},
                 **there.bits(content)}
        other = [f"{name} = {value:g}, not {self._words.values[name]:g}" for name, value in found.items()
                 if name not in there.block.operators and value != self._words.values[name]]
        if other:
            raise InputError(f"{self.mode.address.text} holds other words: {', '.join(other[:3])}; give the folder of "
                             "the controller that runs there")

    def run(self, log: str | Path, aims: Aims | None = None, watching: Watching | None = None) -> Ended:
        """Run it; the log is written as `heatertune.live.recorder.record` writes one.

        Args:
            log: to write.
            aims: when enough is known; None: at the plan's end.
            watching: who watches.

        Raises:
            InputError: there is a log already, or a file of what stood there before: `restore` comes first.
            LinkError: nobody is there at the beginning; nothing has been changed.
        """
        kept = before_of(log)
        if kept.exists():
            raise InputError(f"{kept}: an experiment was cut off; bring back what stood there before with --restore")
        if Path(log).exists():
            raise InputError(f"{log}: is there already; take another name")
        with self.mode.connected() as client:
            before = self.mode.cells(client)
        puts = {self.mode.by_hand(before, power) for power in self.plan.powers}
        write_files(kept.parent, {kept.name: self._kept(before, puts)})
        hand = _Hand(self, before, Path(log), aims or Aims(), watching or Watching())
        restored = None
        try:
            recorded = record(self.mode.address, log, places_of(self._words), self._recording,
                              shown=hand.looked, ended=lambda: hand.ended is not None)
        finally:
            hand.let_go()
            restored = self.mode.give_back(before, puts)
            if restored is not None:
                kept.unlink(missing_ok=True)
            hand.join()
        assert hand.ended is not None
        hand.ended.restored, hand.ended.recorded, hand.ended.fitted = restored, recorded, hand.fitted
        return hand.ended

    def _kept(self, before: bytes, puts: set[bytes]) -> str:
        number, start, _ = self.mode.place
        return json.dumps({
            "schema": BEFORE_SCHEMA, "address": self.mode.address.text, "target": self._words.target, "block": number,
            "start": start, "before": before.hex(), "puts": sorted(put.hex() for put in puts)}, indent=2) + "\n"


class _Hand:
    """The hand on the controller while the recorder looks; it has a connection of its own."""

    def __init__(self, whole: Experiment, before: bytes, log: Path, aims: Aims, watching: Watching) -> None:
        self._whole, self._before, self._log, self._aims, self._watching = whole, before, log, aims, watching
        self._client: Client | None = None
        self._put = before
        self._power: float | None = None
        self._rows = self._fitted_at = self._beats = 0
        self._first_s: float | None = None
        self._latest = list[tuple[float, float]]()
        self._new_at = time.monotonic()
        self._still = StillSensor(whole.heaters, _FROZEN_DEGC) if whole.heaters else None
        self._fitting: Thread | None = None
        self.ended: Ended | None = None
        self.fitted: FittedModel | None = None

    def looked(self, so_far: Recorded) -> None:
        """Act on a look: end it, or go on by the plan."""
        if self.ended is None:
            try:
                self._act(so_far)
            except LinkError as problem:
                self._end("link", str(problem))
        self._watching.shown(so_far, "" if self._power is None else f"{self._power:g} % by hand")

    def _end(self, why: str, told: str) -> None:
        self.ended = Ended(why=why, told=told)

    def _act(self, so_far: Recorded) -> None:
        if so_far.trouble:
            self._end("link", so_far.trouble)
        elif self._watching.key():
            self._end("key", "somebody asked for the end")
        elif so_far.rows == self._rows or so_far.last is None:
            silent_s = time.monotonic() - self._new_at
            if silent_s > self._whole.limits.silence_s:
                self._end("silence", f"no new scan for {silent_s:.0f} s: is the CPU in STOP?")
        else:
            self._rows, self._new_at = so_far.rows, time.monotonic()
            self._new(so_far.last)
        if self.ended is None and self._whole.has_dead_man:
            self._beats = (self._beats + 1) % 65536
            self._asked().write(OWN, OWN_CELLS["heartbeat"][0], self._beats.to_bytes(2, "big"))

    def _new(self, look: Look) -> None:
        """Act on a new reading."""
        self._first_s = look.time_s if self._first_s is None else self._first_s
        after_s, degC = look.time_s - self._first_s, look.seen["temperature"]
        self._latest = [*self._latest[1 - RATE_ROWS :], (look.time_s, degC)]
        broken = self._whole.limits.broken(self._latest, self._whole.sensor_degC)
        if broken is not None:
            self._end(*broken)
        elif frozen := self._frozen(after_s, degC):
            self._end("sensor", frozen)
        elif look.restarted:
            self._end("silence", "the PLC has begun anew")
        elif after_s >= self._whole.plan.ends_s:
            self._end("plan", "the plan is over")
        else:
            self._set(self._whole.plan.power(after_s, degC, self._power))
            self._fit_beside()

    def _frozen(self, after_s: float, degC: float) -> str:
        """Return why the sensor is frozen, a sentence; empty where it need not be, or no heater is known."""
        if self._still is None or self._power is None:
            return ""
        return self._still.see(after_s, degC, self._power)

    def _asked(self) -> Client:
        if self._client is None:
            self._client = self._whole.mode.connected()
        return self._client

    def _set(self, power: float) -> None:
        """Put a power, where what stands there is what was put before; nobody else's change is undone."""
        mode, client = self._whole.mode, self._asked()
        if mode.cells(client) != self._put:
            self._end("hand", "somebody else has changed the mode or the manual value, or the PLC's dead man has")
        elif power != self._power:
            self._put = mode.by_hand(self._before, power)
            mode.put(client, self._put)
            self._power = power

    def _fit_beside(self) -> None:
        """Begin a fit of what there is, beside the looks; end where it knows enough."""
        fit = self._watching.fit
        if fit is None or not self._aims.shares or (self._fitting is not None and self._fitting.is_alive()):
            return
        if self.fitted is not None and self._aims.reached(self.fitted):
            self._end("known", "what was asked for is known")
        elif self._rows >= self._fitted_at + self._aims.every_rows:
            self._fitted_at = self._rows
            self._fitting = Thread(target=self._fit, args=(fit,), name="fit", daemon=True)
            self._fitting.start()

    def _fit(self, fit: Callable[[Path], FittedModel]) -> None:
        with suppress(HeatertuneError):  # too little yet: the next one has more
            self.fitted = fit(self._log)

    def let_go(self) -> None:
        """Close the connection."""
        if self._client is not None:
            self._client.close()

    def join(self) -> None:
        """Wait for a fit that is under way: the controller has been given back by then."""
        if self._fitting is not None:
            self._fitting.join()


def _demand_proven_power(plan: Steps | Relay, words: Words) -> None:
    """Refuse a plan with more power than the words ever ask for: nothing was proven of it."""
    largest = controller_for(words.target).most_power_pct(words)
    highest = max(plan.powers)
    if not highest <= largest + _SAME_PCT:
        raise InputError(f"the plan goes to {highest:g} %, and the words that were proven never ask for more than "
                         f"{largest:.4g} %: plan again with --power 0 {math.floor(largest):g}")


def restore(log: str | Path, words: Words, timeout_s: float = 1.0) -> tuple[bool | None, str]:
    """Finish the way back of an experiment whose program died.

    Args:
        log: that it wrote.
        words: that the controller holds.
        timeout_s: after which an answer is lost [s].

    Returns:
        As `heatertune.live.manual.ManualMode.give_back`, and the address.

    Raises:
        DocumentError: there is no file of what stood there before, or it is damaged, or of another controller.
        InputError: as `Experiment`.
    """
    kept = before_of(log)
    document: Any = read_document(kept, BEFORE_SCHEMA)
    try:
        address, before = address_of(document["address"]), bytes.fromhex(document["before"])
        puts = {bytes.fromhex(put) for put in document["puts"]}
        place = document["block"], document["start"], len(before)
    except (AttributeError, KeyError, TypeError, ValueError) as problem:
        raise DocumentError(f"{kept}: {problem}; expected address, block, start, before and puts") from None
    mode = ManualMode(address, words, timeout_s)
    if place != mode.place or {len(put) for put in puts} != {len(before)}:
        raise DocumentError(f"{kept}: block, byte and bytes {place}; expected {mode.place} for {words.target}")
    restored = mode.give_back(before, puts)
    if restored is not None:
        kept.unlink(missing_ok=True)
    return restored, address.text
