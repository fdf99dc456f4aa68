"""Running zones compared with the limits that their joint proof keeps. Read only.

At rest, every zone is within the tolerance of its setpoint. After a change (of any setpoint, and when the watch
begins), each zone has as long as the slowest proven sequence takes to settle; until then it may be anywhere between
where it was and its setpoint, and beyond both by the largest neighbour deviation and overshoot of a setpoint change in
the proof; after a heat-up or from an unknown state also by its largest overshoot. A load (an open door) also leaves
these limits. Words that are written or watched were proven together again.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Final

import numpy as np

from heatertune.errors import HeatertuneError, InputError, LinkError
from heatertune.live.loop_watch import RestWatch, StillTime, WatchStats
from heatertune.live.poller import Snapshot, StillSensor, reading_problem
from heatertune.live.write.band import Reach, RiseWatch, highest_message
from heatertune.live.write.plc_block import BlockSnapshot, Peer, runs
from heatertune.live.write.proven_words import LEAST_YES
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Words, controller_for
from heatertune.plc.ramp import Number
from heatertune.processors import ProgressCallback
from heatertune.units import count
from heatertune.zones.joint_proof import JointProof
from heatertune.zones.joint_tuning import JOINT_MS, closed_loop_radius, joint_sensitivity, zone_model
from heatertune.zones.zones_folder import ZonesDesign, prove_again, read_zones_design

__all__ = [
    "ProvenZone", "ProvenZones", "ZoneWatchStats", "ZonesWatch", "ZonesWatchResult", "read_proven_zones",
    "watch_zones",
]

_DRAWN: Final = 12  # networks on which words in between have to be stable, besides the ends of the intervals


@dataclass(frozen=True, slots=True, kw_only=True)
class ProvenZone:
    """The words of a zone, and what the proof expects of its loop; see `ExpectedWords`."""

    words: Words
    setpoints_degC: tuple[float, ...]
    tolerance_degC: float
    ambient_degC: float


@dataclass(frozen=True, slots=True, kw_only=True)
class ProvenZones:
    """Words of all zones that were proven together again.

    Attributes:
        design: as its folder has it.
        proof: as it was repeated.
    """

    design: ZonesDesign
    proof: JointProof

    @property
    def yes(self) -> str:
        """What somebody types who has read the proof."""
        return self.design.digest[:8]

    def demand_yes(self, typed: str | None) -> None:
        """Refuse what is not the beginning of the digest.

        Raises:
            InputError: it is not.
        """
        if typed is None or len(typed) < LEAST_YES or not self.design.digest.startswith(typed.lower()):
            entry = "it was not said" if typed is None else f"found {typed!r}"
            raise InputError(f"--confirm: {entry}; expected the first digits of the digest of the proof that you have "
                             f"read, as {self.yes}")

    @property
    def parts(self) -> tuple[ProvenZone, ...]:
        """The words of each zone."""
        spec, network = self.design.specification, self.design.fitted.network
        return tuple(ProvenZone(
            words=words, setpoints_degC=(setpoint,), tolerance_degC=spec.limits.tolerance_degC,
            ambient_degC=ambient) for words, setpoint, ambient in zip(
                self.design.words, spec.setpoints_degC, network.ambients_degC, strict=True))

    def open_in_between(self, values: Sequence[Mapping[str, Number]]) -> str:
        """Return why words of the zones are not stable together on each plausible network; empty where they are.

        Args:
            values: the words that are in the PLC, of each zone.
        """
        try:
            designs = [_decoded(words, own) for words, own in zip(self.design.words, values, strict=True)]
        except HeatertuneError as problem:
            return str(problem)
        words = self.design.words[0]
        delay = controller_for(words.target).delayed_s(words.scaling)
        networks = [network for _, network in self.design.fitted.draw(_DRAWN)]
        with np.errstate(all="ignore"):  # words of others may be anything
            radius = max(closed_loop_radius(network, designs, delay) for network in networks)
            if not radius < 1.0:
                return f"the loops swing together (largest eigenvalue {radius:.4g})"
            size = max(joint_sensitivity(network, designs, delay) for network in networks)
        return "" if size <= JOINT_MS else f"the largest singular value of S is {size:.3g}, limit {JOINT_MS:g}"


def _decoded(words: Words, values: Mapping[str, Number]) -> PidDesign:
    """Return the PID that other values of words make; raise InputError or OutOfRange where they make none."""
    other = replace(words, values={**words.values, **values})
    controller = controller_for(words.target)
    controller.check(other)
    design = controller.decode(other)
    if design is None or not design.gain_pct_per_degC > 0.0:
        raise InputError("they make no PID that heats")
    return replace(design, sample_time_s=words.sample_time_s)


def read_proven_zones(directory: str | Path, progress: ProgressCallback = str) -> ProvenZones:
    """Return the words of a folder that `design --zones` wrote, proven together again.

    Args:
        directory: that holds them.
        progress: called with the name of the step that begins.

    Raises:
        DocumentError, ExportRefused: as `heatertune.zones.zones_folder.read_zones_design` and `prove_again`.
    """
    design = read_zones_design(directory)
    progress("proving all zones together again")
    return ProvenZones(design=design, proof=prove_again(design))


#: criteria of the joint proof: overshoots as a share of the rise, and what a setpoint change moves
_OVERSHOOTS: Final = ("overshoot [%]", "overshoot after a fault [%]", "overshoot after a load [%]")
_MOVES: Final = ("neighbour deviation [°C]", "overshoot of a setpoint change [°C]")
_IN_A_ROW: Final = 2  # readings outside that are more than a disturbed one
_SAME_DEGC: Final = 1e-6
_SIGMAS: Final = 3.0
_SMALL: Final = 0.25  # of the rise from the ambient: up to there a zone settles as after a small change
_STILL_S: Final = 5.0
_STILL: Final = 4.0  # sampling intervals without a new scan: the CPU stands
_APART: Final = 0.2  # of the time to settle; nearer stretches are one
_PERIODS: Final = 3.0  # of PWM, over which swing and power at rest are watched at least
_DISTURBED: Final = 0.01  # of the readings: so many may be unusable


@dataclass(slots=True, kw_only=True)
class ZoneWatchStats(WatchStats):
    """What a watch has seen of a zone.

    Attributes:
        zone: its name.
        temperature_degC: the latest reading [°C].
    """

    zone: str
    temperature_degC: float = math.nan

    def line(self) -> str:
        """Return the zone on one line."""
        if not self.readings:
            return f"{self.zone}: nothing was seen" + (f"; {self.problem}" if self.problem else "")
        state = "WELL" if self.well else "NOT WELL"
        head = (f"{self.zone}: {state}, {self.readings} readings, last {self.temperature_degC:.4g} °C; at most "
                f"{100.0 * self.used:.0f} % of the proven band")
        return "; ".join([head, *self.notes()])

    def to_document(self) -> dict[str, object]:
        """Return it as JSON holds it."""
        return {"zone": self.zone, "well": self.well, **WatchStats.to_document(self)}


class _ZoneSensor:
    """Tells a frozen sensor, and a temperature that rises too fast, of a zone among neighbours of known temperature."""

    def __init__(self, proven: ProvenZones, zone: int) -> None:
        fitted, spec = proven.design.fitted, proven.design.specification
        networks, conditions = [network for _, network in fitted.draw(0)], proven.design.conditions
        self._zone, self._networks = zone, networks
        self._still = [StillSensor([network.neighbours_held(zone)], spec.limits.tolerance_degC) for network in networks]
        noise_degC = max(conditions.noise_degC, *(fitted.noise_degC[zone:zone + 1]), 0.0)
        self._rise = RiseWatch(Reach(proven.design.words[zone], zone_model(
            fitted, zone, networks, spec.setpoints_degC), noise_degC))

    def frozen(self, time_s: float, temperatures_degC: Sequence[float], power_pct: float) -> str:
        """Return why the sensor is frozen on every plausible network, a sentence; empty where it need not be.

        Args:
            time_s: of the readings [s].
            temperatures_degC: of all zones [°C].
            power_pct: of the zone; no number: not known [%].
        """
        messages = [still.see(time_s, temperatures_degC[self._zone], power_pct + network.neighbours_pct(
            self._zone, temperatures_degC)) for network, still in zip(self._networks, self._still, strict=True)]
        return messages[0] if all(messages) else ""

    def rise(self, time_s: float, degC: float) -> str:
        """Return why a temperature rises too fast, see `RiseWatch`."""
        return self._rise.see(time_s, degC)


class ZonesWatch:
    """Takes looks at all zones in their order.

    Attributes:
        zones: what was seen of each zone.
        settle_s: longest time to settle after a small change [s].
        heat_s: longest time to settle after a heat-up [s].
        seconds: that were watched [s].
    """

    def __init__(self, proven: ProvenZones) -> None:
        """Compare with a proof."""
        design, proof = proven.design, proven.proof
        network, words, limits = design.fitted.network, design.words[0], design.specification.limits
        self._conditions, self._sensor_degC = design.conditions, words.scaling.sensor_degC
        step = words.scaling.span_degC / controller_for(words.target).sensor(words.scaling).counts
        noise = max(step, *(_SIGMAS * each for each in (design.conditions.noise_degC, *design.fitted.noise_degC)))
        worst = {each.name: each.value for each in proof.criteria}
        share = 0.01 * max(worst.get(name, 0.0) for name in _OVERSHOOTS)
        moved = max(worst.get(name, 0.0) for name in _MOVES)
        self._rest_degC = limits.tolerance_degC + noise
        rises = np.array(design.specification.setpoints_degC) - np.array(network.ambients_degC)
        self._rises_degC = [max(float(rise), 1.0) for rise in rises]
        self._small_degC = self._rest_degC + max(moved, 0.0)
        self._beyond_degC = [self._small_degC + max(share, 0.0) * rise for rise in self._rises_degC]
        self._is_small = False  # the latest change, from rest
        self.settle_s, self.heat_s = proof.settle_s, proof.heat_s
        self._since_s, self._settles_s = math.nan, 0.0
        self._from: list[float] = []
        self._asked: list[float] = []
        self._rows, self._unusable = [0] * len(design.zones), [0] * len(design.zones)
        self._still_time, self.seconds = StillTime(), 0.0
        self.zones = tuple(ZoneWatchStats(zone=zone, least_drift_pct=network.most_drift_pct(
            number, limits.tolerance_degC)) for number, zone in enumerate(design.zones))
        self._sensors = [_ZoneSensor(proven, zone) for zone in range(len(self.zones))]
        self._rest = [RestWatch(stats, window_s=max(self.settle_s, _PERIODS * design.pwm_period_s),
                                pwm_s=design.pwm_period_s, within_degC=self._rest_degC) for stats in self.zones]

    def see(self, look: Snapshot) -> str:
        """Take a look; return why a zone is outside its limits for several readings; empty where none is."""
        readings = [look.signals[f"{each.zone} temperature"] for each in self.zones]
        setpoints = [look.signals[f"{each.zone} setpoint"] for each in self.zones]
        powers = [look.signals.get(f"{each.zone} power", math.nan) for each in self.zones]
        still_s, self.seconds = self._still_time.see(look)
        for each in self.zones:
            each.still_s, each.seconds = still_s, self.seconds
        usable = [self._is_usable(zone, degC, setpoint) for zone, (degC, setpoint) in enumerate(
            zip(readings, setpoints, strict=True))]
        if all(usable):
            self._note_change(look, readings, setpoints)
            self._note_sensors(look.time_s, readings, powers)
        if not self._asked:
            return self._unusable_reason()
        messages = [self._compare(zone, stats, look.time_s, readings[zone], powers[zone])
                    for zone, stats in enumerate(self.zones) if usable[zone]]
        alarms = (f"zone {each.zone}: {each.alarm or each.frozen}" for each in self.zones if each.alarm or each.frozen)
        return next(filter(None, messages), next(alarms, self._unusable_reason()))

    def _note_sensors(self, time_s: float, temperatures_degC: Sequence[float], powers_pct: Sequence[float]) -> None:
        """Take note of sensors that are frozen, and of temperatures that are too high or rise too fast."""
        for stats, sensor, degC, power in zip(self.zones, self._sensors, temperatures_degC, powers_pct, strict=True):
            stats.frozen = sensor.frozen(time_s, temperatures_degC, power) or stats.frozen
            rise = sensor.rise(time_s, degC)
            stats.alarm = stats.alarm or highest_message(self._conditions, degC) or rise

    def _note_change(self, look: Snapshot, readings: list[float], setpoints: list[float]) -> None:
        """Take note of where all zones are when a setpoint changes, and at the begin."""
        if self._asked and np.allclose(setpoints, self._asked, rtol=0.0, atol=_SAME_DEGC) and not look.restarted:
            return
        far = bool(np.any(np.abs(np.subtract(readings, setpoints)) > _SMALL * np.array(self._rises_degC)))
        left_s = self._since_s + self._settles_s - look.time_s  # no number at the begin
        self._is_small = left_s <= 0.0 and not (far or look.restarted)
        self._since_s = look.time_s
        self._settles_s = (self.heat_s if far else self.settle_s) + max(0.0, left_s)
        self._from, self._asked = readings, setpoints
        for each in self._rest:
            each.restart()

    def _compare(self, zone: int, stats: ZoneWatchStats, time_s: float, degC: float, power_pct: float) -> str:
        setpoint, stats.temperature_degC = self._asked[zone], degC
        if time_s - self._since_s > self._settles_s:
            low, high = setpoint - self._rest_degC, setpoint + self._rest_degC
            if math.isfinite(power_pct):
                self._rest[zone].see(time_s, degC, power_pct)
        else:
            low, high = sorted((self._from[zone], setpoint))
            beyond = self._small_degC if self._is_small else self._beyond_degC[zone]
            low, high = low - beyond, high + beyond
        self._rows[zone] = 0 if stats.compare(degC, (low, high)) else self._rows[zone] + 1
        if self._rows[zone] < _IN_A_ROW:
            return ""
        stats.note_outside(time_s, _APART * self.settle_s)
        return f"zone {stats.zone}: {degC:.4g} °C is outside the proven band, {low:.4g} to {high:.4g} °C"

    def _is_usable(self, zone: int, degC: float, setpoint: float) -> bool:
        problem = reading_problem(degC, self._sensor_degC)
        problem = problem or ("" if math.isfinite(setpoint) else "the setpoint is not a number")
        self._unusable[zone] = self._unusable[zone] + 1 if problem else 0
        if problem:
            stats = self.zones[zone]
            stats.unusable, stats.problem = stats.unusable + 1, problem
            stats.unusable_in_a_row = max(stats.unusable_in_a_row, self._unusable[zone])
        return not problem

    def _unusable_reason(self) -> str:
        return next((f"zone {stats.zone}: {stats.problem}" for stats, row in zip(
            self.zones, self._unusable, strict=True) if row >= _IN_A_ROW), "")

    def short(self) -> str:
        """Return the temperatures of all zones, and the first that is not well, a few words."""
        warm = "".join(f", {each.zone} {each.temperature_degC:.4g} °C" for each in self.zones if each.readings)
        bad = next((each.line() for each in self.zones if each.readings and not each.well), "")
        return f"{warm} NOT WELL: {bad}" if bad else warm

    @property
    def well(self) -> bool:
        """Whether there is nothing to report of any zone."""
        return all(each.well for each in self.zones)


@dataclass(frozen=True, slots=True)
class ZonesWatchResult:
    """How the watch of a write ended.

    Attributes:
        outside: why the words have to be taken back, a sentence; empty where they need not.
        ended_early: why it was not watched to its end; empty where it was.
        seconds: that were watched, of the plant [s].
        count: of looks at all zones.
        most: the largest share of the limits that a zone used.
    """

    outside: str
    ended_early: str
    seconds: float
    count: int
    most: float


def watch_zones(
    peers: Sequence[Peer], proven: ProvenZones, expected: Sequence[Mapping[str, Number]],
    progress: Callable[[str], object] = str,
) -> ZonesWatchResult:
    """Watch the response of all zones to words that were written, until the longest time to settle is over twice.

    Args:
        peers: the block of each zone.
        proven: whose limits count.
        expected: all words of each zone, as they were written.
        progress: called with how far it is.
    """
    response = _Response(peers, proven, expected)
    try:
        while not response.is_over:
            outside, early = response.look()
            if outside or early:
                return response.ended(outside, early)
            progress(response.progress)
            peers[0].pause()
    except LinkError as problem:
        return response.ended("", str(problem))
    except KeyboardInterrupt:
        return response.ended("", "interrupted")
    return response.ended("", response.unsure())


class _Response:
    """The response to a write, while it is watched."""

    def __init__(self, peers: Sequence[Peer], proven: ProvenZones, expected: Sequence[Mapping[str, Number]]) -> None:
        self._peers, self._expected, self._watch = peers, expected, ZonesWatch(proven)
        self._looks, self._moved_s, self._last_s = 0, peers[0].clock.now_s(), math.nan
        self._duration_s = 2.0 * self._watch.settle_s
        self._still_s = max(_STILL_S, _STILL * proven.design.words[0].sample_time_s)

    @property
    def is_over(self) -> bool:
        """Whether it was watched for long enough."""
        return self._watch.seconds >= self._duration_s

    @property
    def progress(self) -> str:
        """How far it is."""
        return f"all zones inside the proven band, {self._watch.seconds:.0f} of {self._duration_s:.0f} s"

    def look(self) -> tuple[str, str]:
        """Look at all zones; return why their words have to be taken back, and why the watch ends early; empty: not.

        Raises:
            LinkError: a zone cannot be read.
        """
        looks = [peer.look() for peer in self._peers]
        if changed := self._changed(looks):
            return "", f"somebody has changed the words: {changed}"
        if runs(looks[-1]) is False:
            return "", "the CPU is in STOP"
        now_s, time_s = self._peers[0].clock.now_s(), looks[-1].time_s
        if time_s == self._last_s:
            return "", "the CPU runs no scan" if now_s - self._moved_s > self._still_s else ""
        self._moved_s, self._last_s, self._looks = now_s, time_s, self._looks + 1
        signals = {f"{zone.zone} {role}": peer.standing.signal(look.content, role) for zone, peer, look in zip(
            self._watch.zones, self._peers, looks, strict=True) for role in ("temperature", "setpoint", "power")
                   if role in peer.standing.block.signals}
        return self._watch.see(Snapshot(time_s, signals)), ""

    def _changed(self, looks: Sequence[BlockSnapshot]) -> str:
        """Return which words are not as they were written; empty where all are."""
        return ", ".join(f"{name} at {peer.address.text}"
                         for peer, look, words in zip(self._peers, looks, self._expected, strict=True)
                         for name in peer.standing.own if look.values[name] != words[name])

    def unsure(self) -> str:
        """Return why the whole watch shows nothing; empty where it shows that the words do well."""
        unusable = sum(each.unusable for each in self._watch.zones)
        few = unusable <= _DISTURBED * self._looks * len(self._peers)
        return "" if few else f"{count(unusable, 'reading')} could not be used"

    def ended(self, outside: str, early: str) -> ZonesWatchResult:
        """Return the end."""
        most = max(each.used for each in self._watch.zones)
        return ZonesWatchResult(outside, early, self._watch.seconds, self._looks, most)
