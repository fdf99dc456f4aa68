"""The exported text, given what the controller saw in a run: it must follow and ask for the same, word for word.

Where it only sets the words of a program that is not in it, it must set what the run had. So, call after call, it would
have made this very run. A broken sensor has to put the heater off, and all to begin anew. What no run sees, as manual,
is left open; so is what a program does after the first `_MOST_CALLS` and `_MOST_TICKS`.
"""

from __future__ import annotations

import hashlib
from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from fractions import Fraction
from itertools import pairwise
from typing import Any, Final, NamedTuple, cast

import numpy as np
import numpy.typing as npt

from heatertune.cache import load_or_compute
from heatertune.errors import InputError
from heatertune.model.findings import Finding
from heatertune.plc.controller import Controller, controller_for
from heatertune.plc.exported import CallInputs, CallOutputs, CallResult, ExportedInPlc, Numbers, TextSettings
from heatertune.plc.open_points import assumptions_from
from heatertune.plc.pwm import INSTANT_S, Actuator, on_time, pulse_ends
from heatertune.plc.ramp import Number
from heatertune.plc.single_precision import real_of, word_of
from heatertune.plc.words import Certificate, Words
from heatertune.proof.loop import in_loop
from heatertune.proof.proof import Proof
from heatertune.proof.trace import Trace

__all__ = ["ComparisonResult", "as_exported", "compare_text"]

_OF_A_TICK: Final = 1e-6
#: of a tick: so little below half a tick `on_time` takes as half a tick, a program that rounds it may not
_BELOW_HALF: Final = 2 * INSTANT_S
#: half a step of the clocks of programs that count in milliseconds [s]
_OF_A_CLOCK_S: Final = 0.0005 + 1e-9
#: of a run call by call, of its beginning tick by tick, and of all periods of the PWM: each less than a second, for a
#: hundred times as many would be waited for
_MOST_CALLS: Final = 20_000
_MOST_TICKS: Final = 5_000
_MOST_OF_PWM: Final = 100_000
_FULLY: Final = 5  # periods tick by tick, where the program counts the ticks beforehand, and so all others are compared


class ComparisonResult(NamedTuple):
    """What running the exported text showed.

    Attributes:
        departs: where it does other than the run, with the file; None: nowhere, or nothing here runs it.
        not_run: what of it was not run, for it would take too long, a few words each.
    """

    departs: str | None = None
    not_run: tuple[str, ...] = ()


def as_exported(proof: Proof) -> Proof:
    """Return a proof, not proven where it passes, but what is exported is known to be wrong, or its text does other.

    What the text does is looked at in the nominal and in the worst run; for the same runs of the same words, once.
    """
    if proof.verdict != "PASS":
        return proof
    controller, basis = controller_for(proof.words.target), proof.diagnostics
    if controller.faults is not None and (faults := controller.faults(proof.words)):
        proof = proof.with_findings([Finding(name="known-faults", message=faults[0])])
        basis = proof.diagnostics
    runs = {proof.runs[run].label: proof.trace(run) for run in dict.fromkeys((0, proof.worst_run))}
    departs, not_run = load_or_compute(
        "text", {"words": repr(proof.words), "known": dict(proof.stated_settings),
                 "runs": {label: _digest(trace) for label, trace in runs.items()}},
        lambda: _all_compared(controller, proof, runs)._asdict(),
        lambda state: ComparisonResult(state["departs"], tuple(state["not_run"])))
    findings = () if departs is None else (Finding(name="exported-text", message=departs),)
    not_tested = tuple(dict.fromkeys((*basis.not_tested, *not_run)))
    return replace(proof, diagnostics=replace(basis, findings=(*basis.findings, *findings), not_tested=not_tested))


def _digest(trace: Trace) -> str:
    """Return a digest of all in a run that the text is compared with."""
    content = repr((trace.model, trace.scenario, trace.actuator, dict(trace.switches), trace.interlock, trace.cut_s))
    digest = hashlib.sha256(content.encode())
    for column in (trace.time_s, trace.reading_degC, trace.followed_degC, trace.power_asked_pct, trace.edge_time_s,
                   trace.edge_pct):
        digest.update(column.tobytes())
    return digest.hexdigest()


def _all_compared(controller: Controller, proof: Proof, runs: Mapping[str, Trace]) -> ComparisonResult:
    """Return what running the text beside runs shows, the first departure of all; by their labels."""
    pulses: dict[str, set[Number]] = {}
    not_run: dict[str, None] = {}
    for label, trace in runs.items():
        departs, left = compare_text(controller, proof.words, trace, proof.stated_settings, pulses=pulses)
        if departs is not None:
            return ComparisonResult(f"{label}: {departs}", tuple(not_run))
        not_run |= dict.fromkeys(left)
    return ComparisonResult(not_run=tuple(not_run))


def compare_text(
    controller: Controller, words: Words, trace: Trace, stated: Mapping[str, str] | None = None, *,
    pulses: dict[str, set[Number]] | None = None,
) -> ComparisonResult:
    """Return where the text of the export does other than a run of these words.

    Args:
        controller: that ran.
        words: that it held.
        trace: of the run. One whose setpoint is led along a profile is not looked at: no export leads it.
        stated: switch → setting that is known or chosen, which the export follows.
        pulses: file → outputs whose PWM was compared in a run before, as its clock was: these are not compared again;
            grows.
    """
    pulses = {} if pulses is None else pulses
    if controller.load_exported is None or trace.scenario.leads:
        return ComparisonResult()
    certificate = Certificate(
        verdict="PASS", setpoint_degC=trace.setpoint_degC, actuator=trace.actuator, switches=stated or {})
    loads = controller.load_exported(controller.export(words, certificate),
                                     assumptions_from(controller.assumptions, trace.switches))
    not_run: dict[str, None] = {}
    for file, load in loads.items():
        try:
            text = load()
            if text is None or isinstance(text, TextSettings):
                shown = ComparisonResult(text and _set_otherwise(text, words, trace))
            else:
                again = cast("Callable[[], ExportedInPlc | None]", load)
                shown = _Comparison(controller, words, trace, text, again).shown(pulses.setdefault(file, set()))
        except InputError as problem:
            shown = ComparisonResult(str(problem))
        if shown.departs is not None:
            return ComparisonResult(f"{file}: {shown.departs}")
        not_run |= dict.fromkeys(shown.not_run)
    return ComparisonResult(not_run=tuple(not_run))


def _set_otherwise(text: TextSettings, words: Words, trace: Trace) -> str | None:
    """Return what a text sets other than a run had it; with the same settings, the same program makes the same run."""
    settings: list[tuple[str, object, object]] = [
        (name, text.values[name], value) for name, value in words.values.items() if name in text.values]
    if len(settings) == len(words.values):
        settings.append(("boost", text.boost, words.boost))
    if text.setpoint_degC is not None:
        settings.append(("setpoint [°C]", text.setpoint_degC, trace.setpoint_degC))
    for name, there, proven in settings:
        if there != proven:
            return f"{name} is {there}; proven is {proven}"
    names = "PWM period", "step of the PWM", "shortest pulse", "shortest pause"
    times = text.period_s, *(text.pulses_s or (None, None, None))
    for name, time_s, proven_s in zip(names, times, trace.actuator.numbers[:4], strict=True):
        if time_s is not None and abs(time_s - proven_s) > _OF_A_CLOCK_S:
            return f"{name} is {time_s:g} s; proven is {proven_s:g} s"
    return None


class _Call(NamedTuple):
    """What a call of the controller saw in the run, and what it gave."""

    time_s: float
    request: Number
    counts: int
    reading_degC: float
    followed_degC: float
    power_pct: float


class _CallRecord(NamedTuple):
    """The same of many calls."""

    time_s: Numbers
    request: npt.NDArray[Any]
    counts: npt.NDArray[np.int64]
    reading_degC: Numbers
    followed_degC: Numbers
    power_pct: Numbers

    @property
    def inputs(self) -> CallInputs:
        return CallInputs(self.request, self.counts, self.reading_degC)

    def some(self, which: slice | npt.NDArray[Any]) -> _CallRecord:
        return _CallRecord(*(cast("Any", each)[which] for each in self))

    def one_by_one(self) -> Iterator[_Call]:
        return map(_Call, *(each.tolist() for each in self))


class _Comparison:
    """A text beside a run; each part tells where it departs."""

    def __init__(
        self, controller: Controller, words: Words, trace: Trace, text: ExportedInPlc,
        load: Callable[[], ExportedInPlc | None]
    ) -> None:
        self._words, self._trace, self._text, self._load = words, trace, text, load
        self._loop = in_loop(controller, words, trace.scenario.setpoints_degC, trace.switches)
        begins = [0.0, *(event.time_s for event in trace.scenario.disturbances)]
        self._phases = np.searchsorted(begins, trace.time_s[:_MOST_CALLS], "right") - 1
        self._calls = self._call_record(controller)
        self._powers: dict[Number, float] = {}  # output asked for → power [%]
        self._not_run: list[str] = []

    def shown(self, pulses: set[Number]) -> ComparisonResult:
        departs = self._of_calls() or (None if pulses else self._of_ticks()) or self._of_pulses(pulses)
        return ComparisonResult(departs, tuple(self._not_run))

    def _call_record(self, controller: Controller) -> _CallRecord:
        trace, scale, some = self._trace, self._words.scaling, slice(_MOST_CALLS)
        readings = trace.reading_degC[some]
        counts = np.rint((readings - scale.low_degC) * (controller.sensor(scale).counts / scale.span_degC)).astype(int)
        return _CallRecord(trace.time_s[some], np.array(self._loop.setpoints)[self._phases], counts, readings,
                     trace.followed_degC[some], trace.power_asked_pct[some])

    def _of_calls(self) -> str | None:
        """Compare setpoint and power at each call."""
        if len(self._phases) < len(self._trace.time_s):
            self._not_run.append(f"what the exported program does after {_MOST_CALLS} calls")
        supplied = np.array(self._trace.scenario.supplied, dtype=bool)[self._phases]
        turns = [0, *(np.flatnonzero(np.diff(supplied)) + 1).tolist(), len(supplied)]
        for begin, end in pairwise(turns):
            if not supplied[begin]:
                continue
            if begin > 0:
                self._text.start()
            if departs := self._of_some(self._calls.some(slice(begin, end))):
                return departs
        return None

    def _of_some(self, calls: _CallRecord) -> str | None:
        """Compare calls between which the supply stays."""
        outputs = self._text.calls(calls.inputs)
        if outputs is not None:
            self._powers.update(zip(outputs.outputs.tolist(), outputs.powers_pct.tolist(), strict=True))
            return self._first(calls, outputs)
        powers, call, zero, unit = self._powers, self._text.call, self._loop.zero_degC, self._loop.unit_degC
        for entry in calls.one_by_one():
            _, request, counts, reading, followed, proven = entry
            setpoint, output, power = result = call(request, counts, reading)
            powers[output] = power
            if zero + unit * setpoint != followed or power != proven:
                return self._difference_of(entry, result)
        return None

    def _of_ticks(self) -> str | None:
        """Compare all tick by tick, from the start-up to the first disturbance, and again after a broken sensor."""
        text, trace, ta = self._text, self._trace, self._words.sample_time_s
        per_call = round(ta / text.tick_s) if text.tick_s > 0.0 else 0
        if abs(per_call * text.tick_s - ta) > _OF_A_TICK:
            return f"its clock ticks every {text.tick_s:g} s; proven is TA = {ta:g} s"
        begin = self._calls.some(slice(_MOST_TICKS // per_call + 1))
        still = (self._phases[: len(begin.time_s)] == 0) & (begin.time_s < trace.cut_s)
        calls = begin.some(np.flatnonzero(still)[:-1])  # after the last one something may happen
        if len(calls.time_s):  # anew, for it may retain what it did
            text = self._text = self._load() or text
            text.start()
        else:
            self._not_run.append(f"an exported clock of more than {_MOST_TICKS} ticks a call")
        if departs := self._of_clock(calls, per_call):
            return departs
        power, on = text.interrupt()
        if power != 0.0 or on:
            return f"while the sensor is broken it asks for {power:.6g} %{', and the heater is on' if on else ''}"
        departs = self._of_clock(calls, per_call)
        return None if departs is None else f"after a broken sensor: {departs}"

    def _of_clock(self, calls: _CallRecord, per_call: int) -> str | None:
        text, trace = self._text, self._trace
        record = calls.some(np.repeat(np.arange(len(calls.time_s)), per_call))
        if not len(record.time_s):
            return None
        ticks = np.tile(np.arange(per_call), len(calls.time_s))
        edges = np.searchsorted(trace.edge_time_s, record.time_s + (ticks + 0.5) * text.tick_s) - 1
        proven = (edges >= 0) & np.array(trace.edge_on, dtype=bool)[edges] if len(trace.edge_on) else edges >= 0
        at_once = text.ticks(record.inputs)
        if at_once is not None:
            switches = False if at_once.on is None else at_once.on != proven
            return self._first(record, at_once, switches, ticks)
        zero, unit = self._loop.zero_degC, self._loop.unit_degC
        for entry, tick, expected in zip(record.one_by_one(), ticks.tolist(), proven.tolist(), strict=True):
            time_s, request, counts, reading, followed, power = entry
            result, on = text.tick(request, counts, reading)
            if zero + unit * result.setpoint != followed or result.power_pct != power:
                return self._difference_of(entry, result)
            if on is not None and on != expected:
                return self._switched(time_s, tick)
        return None

    def _switched(self, time_s: float, tick: int) -> str:
        return f"at {time_s + tick * self._text.tick_s:g} s it switches the heater otherwise than was proven"

    def _first(
        self, record: _CallRecord, outputs: CallOutputs, switches: npt.NDArray[np.bool_] | bool = False,
        ticks: Any = None,
    ) -> str | None:
        """Return what is other first, where all was run at once; `switches`: or where it switches otherwise."""
        followed = self._loop.zero_degC + self._loop.unit_degC * outputs.setpoints
        differs = (followed != record.followed_degC) | (outputs.powers_pct != record.power_pct) | switches
        if not differs.any():
            return None
        first = int(np.argmax(differs))
        call, = record.some(slice(first, first + 1)).one_by_one()
        result = CallResult(*(each[first].item() for each in (outputs.setpoints, outputs.outputs, outputs.powers_pct)))
        return self._difference_of(call, result) or self._switched(call.time_s, int(ticks[first]))

    def _difference_of(self, call: _Call, result: CallResult) -> str | None:
        """Return what the program follows or asks for other than the run at this call."""
        followed = self._loop.zero_degC + self._loop.unit_degC * result.setpoint
        if (followed, result.power_pct) == (call.followed_degC, call.power_pct):
            return None
        return (f"at {call.time_s:g} s it asks for {result.power_pct:.6g} % after setpoint {result.setpoint}; "
                f"proven are {call.power_pct:.6g} %")

    def _of_pulses(self, numbers: set[Number]) -> str | None:
        """Compare the ticks of a period for what was asked for; nothing is carried from one period to the next.

        Args:
            numbers: outputs whose periods are compared already; grows.
        """
        actuator = self._trace.actuator
        ticks = actuator.ticks(self._words.sample_time_s)
        if ticks is None or not self._powers:
            return None
        powers = self._powers | _at_ends(self._powers, actuator)
        outputs = sorted(powers.keys() - numbers)
        numbers.update(powers)  # not "|=", which would make another set: these are the keys of a dict
        if not outputs:
            return None
        period = ticks.per_period
        length = min(period, _MOST_OF_PWM)
        begins = self._text.begin(outputs[0], period)
        if begins is None:
            return None
        counts = self._text.tick_count() is not None
        ticked = _spread(outputs, min(_FULLY if counts else len(outputs), max(1, _MOST_OF_PWM // period)))
        looked = outputs if counts else sorted(ticked)
        proven = [_ticks_on(output, powers[output], actuator) for output in looked]
        lengths = [length if output in ticked else 1 for output in looked]
        for output, nominal, (counted, on) in zip(looked, proven, self._periods(looked, period, lengths), strict=True):
            pairs = [(counted, nominal), *([(on, [min(each, length) for each in nominal])] if output in ticked else [])]
            for ticks_on, right in pairs:
                if ticks_on is not None and all(abs(ticks_on - each) > _OF_A_TICK for each in right):
                    return f"{ticks_on:g} ticks of a period are on at {powers[output]:.6g} %; proven are {right[0]:g}"
        if not counts and len(ticked) < len(outputs):
            self._not_run.append(f"the exported PWM at {len(outputs) - len(ticked)} of {len(outputs)} powers")
        if length < period:
            self._not_run.append(f"the exported PWM after {length} ticks of a period")
        return None


    def _periods(
        self, outputs: Sequence[Number], period: int, lengths: Sequence[int]
    ) -> Iterator[tuple[float | None, int]]:
        """Yield what the program counted beforehand, and how many of so many ticks the heater was on."""
        text, at_once = self._text, self._text.periods(np.array(outputs), period, np.array(lengths))
        if at_once is not None:
            yield from zip(at_once[1].tolist(), at_once[0].tolist(), strict=True)
            return
        for output, length in zip(outputs, lengths, strict=True):
            begins = text.begin(output, period)
            counted = text.tick_count()
            yield counted, bool(begins) + sum(text.go_on() for _ in range(length - 1))


def _ticks_on(output: Number, power_pct: float, actuator: Actuator) -> list[float]:
    """Return how many ticks of a period are on at an output; the one below, too, where `on_time` takes it as half."""
    ticks = Fraction(power_pct) * round(actuator.pwm_period_s / actuator.resolution_s) / 100
    on = on_time(power_pct, 0.0, actuator.numbers)[0] / actuator.resolution_s
    lost = not isinstance(output, int) and 0 < on - Fraction(1, 2) - ticks < _BELOW_HALF
    return [on, on - 1.0] if lost else [on]


def _at_ends(powers: Mapping[Number, float], actuator: Actuator) -> dict[Number, float]:
    """Return the outputs between which pulses begin and pauses end, output → power [%]; powers: some others."""
    output, power = max(powers.items())
    if power <= 0.0:
        return {}
    if isinstance(output, int):
        full = round(100.0 * output / power)
        return {end: 100.0 * end / full for end in _around(pulse_ends(actuator, lambda at: 100.0 * at / full, full))}
    return {real: real for real in map(real_of, _around(pulse_ends(actuator, real_of, word_of(100.0))))}


def _around(ends: tuple[int, int]) -> list[int]:
    least, most = ends
    return [least - 1, least, most, most + 1]


def _spread(ordered: Sequence[Number], count: int) -> set[Number]:
    """Return so many values, from the smallest to the largest one and evenly, or one from the middle, or all."""
    last = len(ordered) - 1
    places = [last / 2.0] if count == 1 else np.linspace(0.0, last, min(count, last + 1))
    return {ordered[round(float(place))] for place in places}
