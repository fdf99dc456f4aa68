"""The exported text, given what the controller saw in a run: it must follow and ask for the same, word for word.

So, call after call, it would have made this very run. What no run sees, a broken sensor or manual, is left open; so are
the calls of a very long run after the first `_MOST_CALLS`.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import Final

import numpy as np

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

__all__ = ["as_exported", "departure"]

_OF_A_TICK: Final = 1e-6
_MOST_CALLS: Final = 20_000  # about a second: a hundred times as many would be waited for


def as_exported(proof: Proof) -> Proof:
    """Return a proof, not proven where it passes, but the export's text does other in its nominal or worst run."""
    if proof.verdict != "PASS":
        return proof
    controller = controller_for(proof.words.target)
    for run in dict.fromkeys((0, proof.worst_run)):
        told = departure(controller, proof.words, proof.traced(run), proof.known)
        if told is not None:
            findings = (*proof.heard.findings, Finding(name="exported-text", told=f"{proof.runs[run].label}: {told}"))
            return replace(proof, heard=replace(proof.heard, findings=findings))
    return proof


def departure(
    controller: Controller, words: Words, trace: Trace, known: Mapping[str, str] | None = None
) -> str | None:
    """Return where the text of the export does other than a run of these words; None: nowhere, or nothing here runs it.

    Args:
        controller: that ran.
        words: that it held.
        trace: of the run. One whose setpoint is led along a profile is not looked at: no export leads it.
        known: switch → setting that is known or chosen, which the export follows.
    """
    if controller.exported is None or trace.scenario.leads:
        return None
    told = Certificate(verdict="PASS", setpoint_degC=trace.setpoint_degC, actuator=trace.actuator,
                       switches=known or {})
    text = controller.exported(controller.export(words, told), assumed(controller.assumptions, trace.switches))
    if text is None:
        return None
    outputs: dict[Number, float] = {}
    return _of_calls(controller, words, trace, text, outputs) or _of_pulses(words, trace, text, outputs)


def _of_calls(
    controller: Controller, words: Words, trace: Trace, text: Exported, outputs: dict[Number, float]
) -> str | None:
    """Compare setpoint and power at each call; enter what was asked for, output → power [%]."""
    scenario, scale = trace.scenario, words.scaling
    loop = in_loop(controller, words, scenario.setpoints_degC, trace.switches)
    begins = [0.0, *(event.time_s for event in scenario.disturbances)]
    time_s, readings = trace.time_s[:_MOST_CALLS], trace.reading_degC[:_MOST_CALLS]
    phases = np.searchsorted(begins, time_s, "right") - 1
    counts = np.rint((readings - scale.low_degC) * (controller.counts / scale.span_degC)).astype(int)
    supplied = True
    for scan, (phase, count) in enumerate(zip(phases.tolist(), counts.tolist(), strict=True)):
        before, supplied = supplied, scenario.supplied[phase]
        if not supplied:
            continue
        if not before:
            text.start()
        made = text.call(loop.asked[phase], count)
        outputs[made.output] = made.power_pct
        followed, power = trace.followed_degC[scan], trace.power_asked_pct[scan]
        if loop.zero_degC + loop.unit_degC * made.setpoint != followed or made.power_pct != power:
            return (f"at {trace.time_s[scan]:g} s it asks for {made.power_pct:.6g} % after setpoint {made.setpoint}; "
                    f"proven are {power:.6g} %")
    return None


def _of_pulses(words: Words, trace: Trace, text: Exported, outputs: Mapping[Number, float]) -> str | None:
    """Compare the ticks of a period for all that was asked for; nothing is carried from one period to the next."""
    ticks = trace.actuator.ticks(words.sample_time_s)
    if ticks is None:
        return None
    for output, power in outputs.items():
        on_s, _ = on_time(power, 0.0, trace.actuator.numbers)
        made = text.pulses(output, ticks.per_period)
        if made is not None and abs(made - on_s / trace.actuator.resolution_s) > _OF_A_TICK:
            return f"{made} ticks of a period are on at {power:.6g} %; proven are {on_s:g} s"
    return None
