"""The PWM period that suits a design and the switch behind it."""

from __future__ import annotations

import math
from dataclasses import replace

from heatertune.model.values import FittedModel
from heatertune.pid.values import PidDesign
from heatertune.plc import Words, controller_for
from heatertune.plc.pwm import tick_for
from heatertune.proof.heaters import ROOM_DEGC
from heatertune.proof.prove_words import setpoints_for
from heatertune.proof.ripple_and_wear import SWITCHES, propose_period
from heatertune.proof.spec_file import specification_of
from heatertune.settings import Conditions

__all__ = ["with_pwm"]

_OF_TOLERANCE = 0.2  # ripple, peak to peak: a fifth of the half band leaves the rest to the loop


def with_pwm(
    design: PidDesign, fitted: FittedModel, kind: str, conditions: Conditions | None = None, *,
    words: Words | None = None,
) -> tuple[PidDesign, Conditions]:
    """Return the design with a note on the PWM period, and the conditions with that period, where they have none.

    They stay as they are where the target makes the PWM itself, with TA as its period: there is nothing to choose.

    Args:
        design: what was tuned.
        fitted: the heater and its candidates.
        kind: "ssr", "relay" or "contactor".
        conditions: of the proof: where the loop rests, and the band, of which the ripple may take a fifth.
        words: what the controller will hold; None: a switch behind its output.

    Raises:
        UnknownName: no such kind of switch.
    """
    assumed = conditions or Conditions()
    setpoint, _ = setpoints_for(fitted, assumed)
    tick = None if words is None else controller_for(words.target).tick_s
    wanted = propose_period(
        fitted.plants, kind=kind, sample_time_s=design.sample_time_s, ambient_degC=ROOM_DEGC, setpoint_degC=setpoint,
        ripple_degC_most=_OF_TOLERANCE * specification_of(assumed).tolerance_degC, tick_s=tick,
    )
    if words is not None and (cycle := controller_for(words.target).cycle) is not None:
        if assumed.pwm_period_s is not None or len(cycle.periods_s) == 1:
            return design, assumed
        least = SWITCHES[kind].shortest_s
        longer = [each for each in cycle.periods_s if each >= least] or [cycle.periods_s[-1]]
        calm = [each for each in longer if each <= wanted.period_s]
        period = calm[-1] if calm and math.isfinite(SWITCHES[kind].life) else longer[0]
        return design, replace(assumed, pwm_period_s=period)
    if words is not None and (own := controller_for(words.target).timing(words).pwm_period_s) is not None:
        note = f"{words.target} makes the PWM itself, period {own:g} s; a switch behind it would get: {wanted.summary}"
        return replace(design, notes=(*design.notes, note)), assumed
    if assumed.pwm_period_s is None:
        resolution = tick_for(tick, sample_time_s=design.sample_time_s, pwm_period_s=wanted.period_s)
        assumed = replace(assumed, pwm_period_s=wanted.period_s, pwm_resolution_s=resolution)
    return replace(design, notes=(*design.notes, wanted.summary)), assumed
