"""The way to the setpoint: a ramp or a boost, chosen in the loop of the proof, that keeps the limit of overshoot.

The gains stay those of the optimum, and with them what a disturbance costs; the price of a ramp is a later heat-up.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, replace
from typing import Final

from heatertune.errors import OutOfRange
from heatertune.model.model_values import FittedModel
from heatertune.model.reduction import cools
from heatertune.plc import Boost, Ramp, Words, controller_for
from heatertune.plc.single_precision import single
from heatertune.processors import ProgressCallback
from heatertune.proof import Proof, prove
from heatertune.proof.criteria import band_of, names_of
from heatertune.proof.heaters import labelled_heaters
from heatertune.proof.long_outage import sums_up, winds_up
from heatertune.proof.phase_statistics import beyond_degC, offset_degC, settling_s, swing_degC
from heatertune.proof.prove_words import RunScreen
from heatertune.proof.runs import judge_once
from heatertune.proof.scenario import TO_SETPOINT
from heatertune.proof.scenario import conditions as conditions_of
from heatertune.proof.text_comparison import as_exported
from heatertune.proof.verdict import FitDiagnostics
from heatertune.settings import Conditions
from heatertune.units import written

__all__ = ["BY_RAMP", "OVERSHOOTS", "REHEATS", "boosts", "prove_ramped", "slow_ramps"]

_STEP: Final = math.sqrt(2.0)  # from one duration to the next, while looking for one that is long enough
_NEAR: Final = 1.03  # the ramp found is the fastest within this factor
_MOST_ROUNDS: Final = 6
_FAR_LONGER: Final = 16.0  # times the longest open circuit of a proof
_OF_SETTLING: Final = 0.8  # of the time until all has settled, that the ramp itself may take
#: times how far from the setpoint is still right, from the loosest on; the looser ones only where none of these will do
_HOLDS: Final = ((8.0, 4.0, 2.0), (32.0, 16.0))
_SHORT_HOLDS: Final = (4.0, 2.0)
_SLOW: Final = (0.125, 0.25, 0.5)  # of the longest ramp
#: of the distance at which the P part alone asks for full power: nearer, the I part has less time to wind up, but more
#: is left to it. The nearest ones, which overshoot sooner, are for an I part that goes on at a limit of the output
_SHARES: Final = ((1.0, 0.7, 0.5, 0.35), (0.25, 0.18, 0.12))
#: between the two distances: of the nearer one; steps of the sensor and standard deviations of its noise, together
_BETWEEN: Final = 0.5
_BOOSTS_STEPS: Final = 4.0
_SIGMAS: Final = 6.0
#: criteria that a slower way to the setpoint helps to keep
OVERSHOOTS: Final = frozenset(names_of(beyond_degC, phases={*TO_SETPOINT} - {"reheat"}))
#: criteria that only a holdback helps to keep: the setpoint is at its end when the heater's circuit opens
REHEATS: Final = frozenset(names_of(beyond_degC, settling_s, phases=("reheat",)))
#: what stays where even the slowest way to the setpoint leaves it
_UNLED: Final = frozenset(names_of(offset_degC, swing_degC, settling_s, phases=("recovery",)))
#: what a windup on the way leaves behind
_LEFT_BEHIND: Final = _UNLED.union(names_of(settling_s, phases={*TO_SETPOINT} - {"reheat"}))
#: what each slower way mends a little more of
_LED: Final = frozenset(names_of(beyond_degC, phases=TO_SETPOINT))
_MENDED: Final = 0.5  # of what the fastest way breaks it by: where the slowest leaves more, none between them keeps it
#: all that a ramp with a holdback may mend
BY_RAMP: Final = OVERSHOOTS | REHEATS | _LEFT_BEHIND


def prove_ramped(
    words: Words, fitted: FittedModel, ramp: float | str | None = None, conditions: Conditions | None = None, *,
    plain: Proof | None = None, gains_open: bool = False, text: bool = True, progress: ProgressCallback = str,
) -> tuple[Proof, list[str]]:
    """Return the proof of words with a setpoint ramp, its words with the ramp, and what is to be told about it.

    Args:
        words: that were chosen.
        fitted: the heater and its candidates.
        ramp: [°C/min]; "none": at once; "auto": the fastest that keeps the limits on overshoot in every run, where
            they are broken without one, and with a holdback where that takes one; None: as the words have it, and,
            where nothing but these limits is broken, told what "auto" would find. It takes the place of a boost.
        conditions: of the proof.
        plain: the proof of these words under these conditions without a ramp, where there is one already.
        gains_open: whether other gains are tried where a ramp leaves what those mend; else a slower ramp is looked for.
        text: whether the exported text is run, too, see `as_exported`.
        progress: called with a few words as each step begins.

    Raises:
        InputError: a ramp for a controller that has none, or as `prove`.
        OutOfRange, UnknownName: as `prove`; a rate that the controller cannot have.
    """
    proof, told = _ramped(words, fitted, ramp, conditions, plain, sums_up if gains_open else winds_up, progress)
    return as_exported(proof) if text else proof, told


def boosts(words: Words, screen: RunScreen, conditions: Conditions) -> Iterator[Boost]:
    """Yield the boosts with which words keep the limits in runs that were failed, the nearest ones last.

    Of either, that which settles first comes first.

    Args:
        words: without one.
        screen: the runs.
        conditions: of the proof.
    """
    for shares in _SHARES:
        settled = [(settles, boost.within_degC, boost) for boost in _tried(words, conditions, shares)
                   if (settles := screen.settles(words.with_boost(boost), conditions)) is not None]
        yield from (boost for *_, boost in sorted(settled, key=lambda entry: entry[:2]))


def _tried(words: Words, conditions: Conditions, shares: Sequence[float]) -> Iterator[Boost]:
    controller, span = controller_for(words.target), words.scaling.span_degC
    design = controller.decode(words)
    if design is None:
        return
    least = _BOOSTS_STEPS * span / controller.counts + _SIGMAS * abs(conditions.noise_degC)
    for share in shares:
        within = _short(share * controller.most_power_pct(words) / abs(design.gain_pct_per_degC))
        again = _short(within + max(_BETWEEN * within, least))
        if within < again < span:
            yield Boost(within_degC=within, again_degC=again)


def _short(distance_degC: float) -> float:
    """Return a distance in three digits, as a single."""
    return single(float(f"{distance_degC:.3g}"))


def slow_ramps(proof: Proof, fitted: FittedModel) -> Iterator[Words]:
    """Yield the words of a proof with setpoint ramps slower than its test sequence needs, with a short holdback.

    The longer holdback comes first: the I part of a restarted controller begins at zero, however short the outage was,
    and sums up no more than the holdback leaves it.

    Args:
        proof: of a loop whose setpoint such a ramp leads.
        fitted: the heater and its candidates.
    """
    band = math.copysign(band_of(proof.limits, proof.nominal.resolution_degC), -1.0 if cools(fitted) else 1.0)
    for times in _SHORT_HOLDS:
        search = _Search(plain=proof, fitted_model=fitted, conditions=Conditions(), hold_degC=times * band)
        yield from filter(None, (search.with_duration(share * search.longest_s) for share in _SLOW))


@judge_once()
def _ramped(
    words: Words, fitted: FittedModel, ramp: float | str | None, conditions: Conditions | None, plain: Proof | None,
    wound: Callable[[FitDiagnostics], bool], progress: ProgressCallback,
) -> tuple[Proof, list[str]]:
    words, controller = _with_ramp(words, ramp), controller_for(words.target)
    if plain is None or plain.words != words:
        plain = prove(words, fitted, conditions)
    if words.ramp is not None or ramp == "none":
        return plain, []
    broken = {*plain.broken_criteria}
    alone = bool(broken) and broken <= OVERSHOOTS | REHEATS
    helps = bool(broken & BY_RAMP) if ramp == "auto" else alone
    if not helps or not controller.has_ramp:
        return plain, [_why_none(plain, sorted(broken), ramped=controller.has_ramp)] if ramp == "auto" else []
    progress("looking for the fastest setpoint ramp that keeps the limit on overshoot")
    search = _Search(plain=plain, fitted_model=fitted, conditions=conditions or Conditions(), winds_up=wound)
    ramped = _cheapest(search, broken)
    if ramped is None:
        return plain, ["No setpoint ramp that ends half way to the disturbance keeps the limit on overshoot."]
    price = _price_text(plain, ramped)
    if ramp != "auto":
        failed, fail = " and the ".join(sorted(broken)).replace("_", " "), "fails" if len(broken) == 1 else "fail"
        return plain, [f"Only the {failed} {fail}. --setpoint-ramp auto would mend it: with {price}"]
    if ramped.verdict != "FAIL" or alone:
        return ramped, [f"With {price}"]
    return plain, [f"A setpoint ramp mends the overshoot alone: with {price}"]


def _with_ramp(words: Words, ramp: float | str | None) -> Words:
    """Return words with a ramp of so many °C/min, or without; as they are where nothing is said."""
    if isinstance(ramp, float | int):
        return replace(words, ramp=controller_for(words.target).ramp(words, ramp), boost=None)
    return words if ramp is None else replace(words, ramp=None, boost=words.boost if ramp == "none" else None)


def _cheapest(search: _Search, broken: set[str]) -> Proof | None:
    """Return the proof with the fastest ramp without holdback, with one that settles first where that passes alone."""
    free = None if broken & REHEATS else _fastest(search, broken)
    if (free is not None and search.passes(free)) or not broken <= BY_RAMP:
        return free
    wound = None if free is None or free.verdict == "FAIL" else free
    side = -1.0 if cools(search.fitted_model) else 1.0
    band = band_of(search.plain.limits, search.plain.nominal.resolution_degC)
    for holds in _HOLDS:
        held, wound_up = _soonest([replace(search, hold_degC=side * times * band) for times in holds])
        if held is not None and (not wound_up or search.sum_ends(held, wound_up)):
            return held
        wound = wound or next(iter(wound_up), None)
    return wound or free


def _soonest(searches: Sequence[_Search]) -> tuple[Proof | None, list[Proof]]:
    """Return the proof that passes and settles first, and those that keep the limits of the test sequence but wind up.

    Most holds leave the ramp itself next to nothing to do: they come first, and what they need is the most that
    another one may take.
    """
    at_once = {search.hold_degC: settles for search in searches if (settles := search.settles_at_once()) is not None}
    best: Proof | None = None
    wound_up = list[Proof]()
    for search in sorted(searches, key=lambda entry: at_once.get(entry.hold_degC, math.inf)):
        if best is not None and search.hold_degC in at_once:
            continue
        ramped = search.fastest(None if best is None else _value(best, "settling_time"))
        if ramped is None or ramped.verdict == "FAIL":
            continue
        if not search.passes(ramped):
            wound_up.append(ramped)
        elif best is None or _value(ramped, "settling_time") < _value(best, "settling_time"):
            best = ramped
    return best, wound_up


def _fastest(search: _Search, broken: set[str]) -> Proof | None:
    """Return the proof with the fastest ramp that mends all it can mend, else with the fastest that mends overshoot."""
    kept = OVERSHOOTS | _LEFT_BEHIND
    wanted = [kept, OVERSHOOTS] if broken & _LEFT_BEHIND and broken & OVERSHOOTS else [kept & (broken | OVERSHOOTS)]
    searches = (replace(search, kept_limits=names) for names in wanted)
    return next((ramped for search in searches if (ramped := search.fastest()) is not None), None)


def _why_none(plain: Proof, broken: list[str], *, ramped: bool) -> str:
    if not broken:
        overshoot = _value(plain, "overshoot")
        return (f"No setpoint ramp is needed: the worst overshoot without one is {overshoot:.3g} % of the rise, within "
                "its limit.")
    if not ramped:
        return f"{plain.words.target} has no setpoint ramp."
    return f"No setpoint ramp was looked for: it mends nothing but overshoot, and {', '.join(broken)} fails."


def _price_text(plain: Proof, ramped: Proof) -> str:
    def change(name: str, unit: str) -> str:
        return f"from {written(_value(plain, name))} to {written(_value(ramped, name))} {unit}"

    others = ramped.broken_criteria
    fails = f" {' and '.join(others)} fails with it." if others else ""
    held = f", which follows the reading within {ramped.hold_degC:.3g} °C," if ramped.hold_degC is not None else ""
    opened = f", after an open circuit {change('reheat_overshoot', '% of the rise')}" if held else ""
    rise = "% of the rise"
    return (
        f"a setpoint ramp of {ramped.ramp_degC_per_min:.3g} °C/min ({ramped.words.ramp}){held} the worst overshoot "
        f"goes {change('overshoot', rise)}{opened}, and the worst settling time {change('settling_time', 's')}. The "
        f"gains are the same: after the disturbance the worst deviation goes {change('deviation', '°C')}, the recovery "
        f"time {change('recovery_time', 's')}.{fails}"
    )


def _value(proof: Proof, name: str) -> float:
    return next(criterion.value for criterion in proof.criteria if criterion.name == name)


@dataclass(frozen=True, slots=True, kw_only=True)
class _Search:
    plain: Proof
    fitted_model: FittedModel
    conditions: Conditions
    kept_limits: frozenset[str] = BY_RAMP
    hold_degC: float | None = None
    winds_up: Callable[[FitDiagnostics], bool] = winds_up

    def passes(self, proof: Proof) -> bool:
        """Return whether a proof keeps every limit, after a longer open circuit, too."""
        return proof.verdict != "FAIL" and not self.winds_up(proof.diagnostics)

    def sum_ends(self, proof: Proof, wound_up: Sequence[Proof]) -> bool:
        """Return whether a proof keeps its limits after far longer open circuits, too, in the runs others wind up in.

        A sum without an end breaks them after one that is long enough, however slow the ramp is.
        """
        screen = RunScreen(fitted_model=self.fitted_model, night_times=_FAR_LONGER).with_nights(wound_up)
        return not screen.wound(proof.words, self.conditions)

    def settles_at_once(self) -> float | None:
        """Return after what time the worst runs settle with the fastest ramp there is [s]; None: they fail."""
        words = next(filter(None, map(self.with_duration, self._durations())), None)
        if words is None:
            return None
        return self._watched.settles(words, self.conditions)

    def fastest(self, within_s: float | None = None) -> Proof | None:
        """Return the proof with the fastest ramp found.

        Only the worst runs are looked at, until a whole proof finds another one that breaks a limit; that one is then
        watched as well, as is a longer open circuit after which a sum breaks one. Where no slower ramp mends that, the
        proof is returned as it is. Overshoot need not fall with each slower ramp, so the durations are walked through
        from the shortest, and only the last stretch is halved.

        Args:
            within_s: all shall have settled by then [s]; None: half of the time before the disturbance is for the ramp.
        """
        watched = self._watched
        wound: Proof | None = None
        for _ in range(_MOST_ROUNDS):
            words = self._fastest_on(watched) if within_s is None else self._fastest_within(within_s, watched)
            if words is None or (wound is not None and words == wound.words):
                return wound
            proof = prove(words, self.fitted_model, self.conditions)
            if any(not criterion.ok for criterion in proof.criteria if criterion.name in self.kept_limits):
                watched = watched.with_failed(proof)
            elif self.winds_up(proof.diagnostics):
                wound, watched = wound or proof, watched.with_nights([proof])
            else:
                ends = wound is None or self.sum_ends(proof, [wound])
                return proof if ends else wound
        return wound

    @property
    def _watched(self) -> RunScreen:
        return RunScreen(fitted_model=self.fitted_model, names=self.kept_limits).with_failed(self.plain)

    def _fastest_on(self, watched: RunScreen) -> Words | None:
        shorter, hopeful = None, False
        for duration in self._durations():
            words = self.with_duration(duration)
            if words is not None and self._keeps(words, watched):
                return self._refined(shorter, duration, words, watched)
            hopeful = hopeful or words is None or self._hopeful(words, watched)
            if not hopeful:
                return None
            shorter = duration
        return None

    def _hopeful(self, fastest: Words, watched: RunScreen) -> bool:
        """Return whether the slowest ramp keeps what no way mends, and by far more of the rest than the fastest."""
        slowest = self.with_duration(self.longest_s)
        if slowest is None:
            return False
        unled = any(each.name in _UNLED and not each.ok for each in self.plain.criteria)
        if unled and not self._keeps(slowest, replace(watched, names=self.kept_limits & _UNLED)):
            return False
        led = replace(watched, names=self.kept_limits & _LED)
        left = led.badness(slowest, self.conditions)
        return left == 0.0 or left <= _MENDED * led.badness(fastest, self.conditions)

    def _fastest_within(self, seconds: float, watched: RunScreen) -> Words | None:
        longest = min(_OF_SETTLING * seconds, self.longest_s)
        words = self.with_duration(longest)
        if words is None or not self._keeps(words, watched):
            return None
        return self._refined(next(self._durations()), longest, words, watched)

    def _refined(self, shorter: float | None, longer: float, words: Words, watched: RunScreen) -> Words:
        while shorter is not None and longer > _NEAR * shorter:
            between = math.sqrt(shorter * longer)
            tried = self.with_duration(between)
            if tried is not None and self._keeps(tried, watched):
                longer, words = between, tried
            else:
                shorter = between
        return words

    def _durations(self) -> Iterator[float]:
        """Return how long a ramp may take, from a few calls up to half of the time before the disturbance [s]."""
        duration = 4.0 * controller_for(self.plain.words.target).timing(self.plain.words).scan_s
        while duration < self.longest_s:
            yield duration
            duration *= _STEP
        yield self.longest_s

    @property
    def longest_s(self) -> float:
        """How long a ramp may take [s]."""
        scenario = self.plain.scenario
        return (scenario.disturbances[0].time_s if scenario.disturbances else scenario.duration_s) / 2.0

    def with_duration(self, duration_s: float) -> Words | None:
        """Return the words with a ramp that takes so long on the nominal heater; None where there can be none."""
        scenario, words = self.plain.scenario, self.plain.words
        model = dict(labelled_heaters(self.fitted_model))[self.plain.runs[0].model]
        way = abs(scenario.setpoint_degC - conditions_of(scenario, model)[1])
        try:
            ramp: Ramp = controller_for(words.target).ramp(words, 60.0 * way / duration_s, self.hold_degC)
        except OutOfRange:
            return None
        return replace(words, ramp=ramp, boost=None)

    def _keeps(self, words: Words, watched: RunScreen) -> bool:
        return watched.keeps(words, self.conditions)
