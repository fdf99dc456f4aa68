"""The setpoint ramp: chosen in the loop of the proof, so that the overshoot of the heat-up keeps its limit.

The gains stay those of the optimum, and with them what a disturbance costs; the price is a later heat-up.
"""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Final

from heatertune.errors import OutOfRange
from heatertune.model.values import FittedModel
from heatertune.plc import Ramp, Words, controller_for
from heatertune.progress import Told
from heatertune.proof import Criterion, Proof, RunResult, prove, prove_models
from heatertune.proof.heaters import labelled
from heatertune.proof.scenario import conditions as conditions_of
from heatertune.settings import Conditions

__all__ = ["prove_ramped"]

_STEP: Final = math.sqrt(2.0)  # from one duration to the next, while looking for one that is long enough
_NEAR: Final = 1.03  # the ramp found is the fastest within this factor
_MOST_ROUNDS: Final = 6


def prove_ramped(
    words: Words, fitted: FittedModel, ramp: float | str | None = None, conditions: Conditions | None = None, *,
    progress: Told = str,
) -> tuple[Proof, list[str]]:
    """Return the proof of words with a setpoint ramp, its words with the ramp, and what is to be told about it.

    Args:
        words: that were chosen.
        fitted: the heater and its candidates.
        ramp: [°C/min]; "none": at once; "auto": the fastest that keeps the limit on overshoot in every run, where
            that is broken without one; None: as the words have it, and, where nothing but that limit is broken, told
            what "auto" would find.
        conditions: of the proof.
        progress: told what begins.

    Raises:
        InputError: a ramp for a room that has none, or as `prove`.
        OutOfRange, UnknownName: as `prove`; a rate that the room cannot have.
    """
    found = controller_for(words.target)
    if isinstance(ramp, float | int):
        words = replace(words, ramp=found.ramp(words, ramp))
    elif ramp is not None:
        words = replace(words, ramp=None)
    plain = prove(words, fitted, conditions)
    if words.ramp is not None or ramp == "none":
        return plain, []
    broken = [criterion.name for criterion in plain.criteria if not criterion.ok]
    helps = "overshoot" in broken if ramp == "auto" else broken == ["overshoot"]
    if not helps or not found.ramped:
        return plain, [_why_none(plain, broken, ramped=found.ramped)] if ramp == "auto" else []
    progress("looking for the fastest setpoint ramp that keeps the limit on overshoot")
    ramped = _Search(plain=plain, fitted=fitted, conditions=conditions).fastest()
    if ramped is None:
        return plain, ["No setpoint ramp that ends half way to the disturbance keeps the limit on overshoot."]
    told = _told(plain, ramped)
    if ramp == "auto" and (ramped.verdict != "FAIL" or broken == ["overshoot"]):
        return ramped, [f"With {told}"]
    if ramp == "auto":
        return plain, [f"A setpoint ramp mends the overshoot alone: with {told}"]
    return plain, [f"Only the overshoot fails. --setpoint-ramp auto would mend it: with {told}"]


def _why_none(plain: Proof, broken: list[str], *, ramped: bool) -> str:
    if not broken:
        overshoot = _value(plain, "overshoot")
        return f"No setpoint ramp is needed: the worst overshoot without one is {overshoot:.3g} %, within its limit."
    if not ramped:
        return f"{plain.words.target} has no setpoint ramp."
    return f"No setpoint ramp was looked for: it mends nothing but overshoot, and {', '.join(broken)} fails."


def _told(plain: Proof, ramped: Proof) -> str:
    def change(name: str, unit: str) -> str:
        return f"from {_value(plain, name):.4g} to {_value(ramped, name):.4g} {unit}"

    others = [criterion.name for criterion in ramped.criteria if not criterion.ok]
    fails = f" {' and '.join(others)} fails with it." if others else ""
    return (
        f"a setpoint ramp of {ramped.ramp_degC_per_min:.3g} °C/min ({ramped.words.ramp}) the worst overshoot goes "
        f"{change('overshoot', '%')}, and the worst settling time {change('settling_time', 's')}. The gains are the "
        f"same: after the disturbance the worst deviation goes {change('deviation', '°C')}, the recovery time "
        f"{change('recovery_time', 's')}.{fails}"
    )


def _value(proof: Proof, name: str) -> float:
    return next(criterion.value for criterion in proof.criteria if criterion.name == name)


def _overshoot(proof: Proof | RunResult) -> Criterion:
    return next(criterion for criterion in proof.criteria if criterion.name == "overshoot")


@dataclass(frozen=True, slots=True, kw_only=True)
class _Search:
    plain: Proof
    fitted: FittedModel
    conditions: Conditions | None

    def fastest(self) -> Proof | None:
        """Return the proof with the fastest ramp found.

        Only the worst run is looked at, until a whole proof finds another one that breaks the limit; that one is then
        watched as well. Overshoot need not fall with each slower ramp, so the durations are walked through from the
        shortest, and only the last stretch is halved.
        """
        watched: list[RunResult] = [_worst(self.plain)]
        for _ in range(_MOST_ROUNDS):
            words = self._fastest_on(watched)
            if words is None:
                return None
            proof = prove(words, self.fitted, self.conditions)
            if _overshoot(proof).ok:
                return proof
            watched.append(_worst(proof))
        return None

    def _fastest_on(self, watched: list[RunResult]) -> Words | None:
        shorter = None
        for duration in self._durations():
            words = self._with(duration)
            if words is None or not self._keeps(words, watched):
                shorter = duration
                continue
            return self._refined(shorter, duration, words, watched)
        return None

    def _refined(self, shorter: float | None, longer: float, words: Words, watched: list[RunResult]) -> Words:
        while shorter is not None and longer > _NEAR * shorter:
            between = math.sqrt(shorter * longer)
            tried = self._with(between)
            if tried is not None and self._keeps(tried, watched):
                longer, words = between, tried
            else:
                shorter = between
        return words

    def _durations(self) -> Iterator[float]:
        """Return how long a ramp may take, from a few calls up to half of the time before the disturbance [s]."""
        scenario = self.plain.scenario
        stops = [each.time_s for each in scenario.disturbances]
        longest = (stops[0] if stops else scenario.duration_s) / 2.0
        duration = 4.0 * controller_for(self.plain.words.target).timing(self.plain.words).scan_s
        while duration < longest:
            yield duration
            duration *= _STEP
        yield longest

    def _with(self, duration_s: float) -> Words | None:
        """Return the words with a ramp that takes so long on the nominal heater; None where the room cannot have it."""
        scenario, words = self.plain.scenario, self.plain.words
        way = scenario.setpoint_degC - conditions_of(scenario, dict(labelled(self.fitted))[self.plain.runs[0].model])[1]
        try:
            ramp: Ramp = controller_for(words.target).ramp(words, 60.0 * way / duration_s)
        except OutOfRange:
            return None
        return replace(words, ramp=ramp)

    def _keeps(self, words: Words, watched: list[RunResult]) -> bool:
        plain, models = self.plain, dict(labelled(self.fitted))
        return all(
            _overshoot(prove_models(controller_for(words.target), words, [(run.model, models[run.model])],
                                    plain.scenario, plain.actuator, plain.limits, known=run.switches,
                                    interlock=plain.interlock)).ok
            for run in watched
        )


def _worst(proof: Proof) -> RunResult:
    """Return the run with the largest overshoot."""
    return max(proof.runs, key=lambda run: _overshoot(run).value)
