"""The exported text, given what the controller saw in a run: it must follow and ask for the same, word for word.

So, call after call, it would have made this very run. What no run sees, a broken sensor or manual, is left open; so is
what a program does after the first `_MOST_CALLS` and `_MOST_TICKS`.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from typing import Final, NamedTuple

import numpy as np

from heatertune.errors import InputError
from heatertune.model.findings import Finding
from heatertune.plc.controller import Controller, controller_for
from heatertune.plc.exported import Exported
from heatertune.plc.open_points import assumed
from heatertune.plc.pwm import on_time
from heatertune.plc.ramp import Number
from heatertune.plc.words import Certificate, Words
from heatertune.proof.loop import in_loop
from heatertune.proof.prove import Proof
from heatertune.proof.trace import Trace

__all__ = ["Compared", "as_exported", "compared"]

_OF_A_TICK: Final = 1e-6
#: of a run; of the clock, and of all periods of the PWM: each about a second, for a hundred times as many would be
#: waited for
_MOST_CALLS: Final = 20_000
_MOST_TICKS: Final = 100_000
_FULLY: Final = 5  # periods tick by tick, where the program counts the ticks beforehand, and so all others are compared


class Compared(NamedTuple):
    """What running the exported text showed.

    Attributes:
        departs: where it does other than the run, with the file; None: nowhere, or nothing here runs it.
        not_run: what of it was not run, for it would take too long, a few words each.
    """

    departs: str | None = None
    not_run: tuple[str, ...] = ()


def as_exported(proof: Proof) -> Proof:
    """Return a proof, not proven where it passes, but the export's text does other in its nominal or worst run."""
    if proof.verdict != "PASS":
        return proof
    controller, heard = controller_for(proof.words.target), proof.heard
    for run in dict.fromkeys((0, proof.worst_run)):
        departs, not_run = compared(controller, proof.words, proof.traced(run))
        if departs is not None:
            finding = Finding(name="exported-text", told=f"{proof.runs[run].label}: {departs}")
            return replace(proof, heard=replace(heard, findings=(*heard.findings, finding)))
        heard = replace(heard, not_tested=tuple(dict.fromkeys((*heard.not_tested, *not_run))))
    return replace(proof, heard=heard)


def compared(controller: Controller, words: Words, trace: Trace) -> Compared:
    """Return where the text of the export does other than a run of these words.

    Args:
        controller: that ran.
        words: that it held.
        trace: of the run. One whose setpoint is led along a profile is not looked at: no export leads it.
    """
    if controller.exported is None or trace.scenario.leads:
        return Compared()
    told = Certificate(verdict="PASS", setpoint_degC=trace.setpoint_degC, actuator=trace.actuator)
    loads = controller.exported(controller.export(words, told), assumed(controller.assumptions, trace.switches))
    not_run: dict[str, None] = {}
    for file, load in loads.items():
        try:
            text = load()
            shown = Compared() if text is None else _Comparison(controller, words, trace, text).shown()
        except InputError as problem:
            shown = Compared(str(problem))
        if shown.departs is not None:
            return Compared(f"{file}: {shown.departs}")
        not_run |= dict.fromkeys(shown.not_run)
    return Compared(not_run=tuple(not_run))


class _Comparison:
    """A text beside a run; each part tells where it departs."""

    def __init__(self, controller: Controller, words: Words, trace: Trace, text: Exported) -> None:
        self._controller, self._words, self._trace, self._text = controller, words, trace, text
        self._powers: dict[Number, float] = {}  # output asked for → power [%]
        self._not_run: list[str] = []

    def shown(self) -> Compared:
        departs = self._of_calls() or self._of_clock() or self._of_pulses()
        return Compared(departs, tuple(self._not_run))

    def _of_calls(self) -> str | None:
        """Compare setpoint and power at each call."""
        trace, words = self._trace, self._words
        scenario, scale = trace.scenario, words.scaling
        loop = in_loop(self._controller, words, scenario.setpoints_degC, trace.switches)
        begins = [0.0, *(event.time_s for event in scenario.disturbances)]
        time_s, readings = trace.time_s[:_MOST_CALLS], trace.reading_degC[:_MOST_CALLS]
        if len(time_s) < len(trace.time_s):
            self._not_run.append(f"what the exported program does after {_MOST_CALLS} calls")
        phases = np.searchsorted(begins, time_s, "right") - 1
        counts = np.rint((readings - scale.low_degC) * (self._controller.counts / scale.span_degC)).astype(int)
        supplied = True
        for scan, (phase, count, reading) in enumerate(zip(
                phases.tolist(), counts.tolist(), readings.tolist(), strict=True)):
            before, supplied = supplied, scenario.supplied[phase]
            if not supplied:
                continue
            if not before:
                self._text.start()
            made = self._text.call(loop.asked[phase], count, reading)
            self._powers[made.output] = made.power_pct
            followed, power = trace.followed_degC[scan], trace.power_asked_pct[scan]
            if loop.zero_degC + loop.unit_degC * made.setpoint != followed or made.power_pct != power:
                return (f"at {trace.time_s[scan]:g} s it asks for {made.power_pct:.6g} % after setpoint "
                        f"{made.setpoint}; proven are {power:.6g} %")
        return None

    def _of_clock(self) -> str | None:
        """Compare the time from one call to the next."""
        interval_s, ta = self._text.interval_s(_MOST_TICKS), self._words.sample_time_s
        if interval_s is None:
            self._not_run.append(f"an exported clock of more than {_MOST_TICKS} ticks a call")
        elif abs(interval_s - ta) > _OF_A_TICK:
            return f"it calls the controller every {interval_s:g} s; proven is TA = {ta:g} s"
        return None

    def _of_pulses(self) -> str | None:
        """Compare the ticks of a period for what was asked for; nothing is carried from one period to the next."""
        actuator = self._trace.actuator
        ticks = actuator.ticks(self._words.sample_time_s)
        if ticks is None or not self._powers:
            return None
        period = ticks.per_period
        outputs, length = sorted(self._powers), min(period, _MOST_TICKS)
        begins = self._text.begin(outputs[0], period)
        if begins is None:
            return None
        counts = self._text.counted() is not None
        ticked = _spread(outputs, min(_FULLY if counts else len(outputs), max(1, _MOST_TICKS // period)))
        for output in outputs if counts else sorted(ticked):
            on_s, _ = on_time(self._powers[output], 0.0, actuator.numbers)
            proven = on_s / actuator.resolution_s
            begins = self._text.begin(output, period)
            made = [(self._text.counted(), proven)]
            if output in ticked:
                on = bool(begins) + sum(self._text.tick() for _ in range(length - 1))
                made.append((on, min(proven, length)))
            for ticks_on, wanted in made:
                if ticks_on is not None and abs(ticks_on - wanted) > _OF_A_TICK:
                    return (f"{ticks_on:g} ticks of a period are on at {self._powers[output]:.6g} %; proven are "
                            f"{wanted:g}")
        if not counts and len(ticked) < len(outputs):
            self._not_run.append(f"the exported PWM at {len(outputs) - len(ticked)} of {len(outputs)} powers")
        if length < period:
            self._not_run.append(f"the exported PWM after {length} ticks of a period")
        return None


def _spread(ordered: Sequence[Number], count: int) -> set[Number]:
    """Return so many values, from the smallest to the largest one and evenly, or one from the middle, or all."""
    last = len(ordered) - 1
    places = [last / 2.0] if count == 1 else np.linspace(0.0, last, min(count, last + 1))
    return {ordered[round(float(place))] for place in places}
