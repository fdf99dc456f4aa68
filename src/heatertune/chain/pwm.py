"""The PWM period that suits a design and the switch behind it."""

from __future__ import annotations

from dataclasses import replace

from heatertune.chain.stages import ROOM_DEGC, default_setpoint
from heatertune.model.values import FittedModel
from heatertune.pid.values import PidDesign
from heatertune.plc import Words, controller_for
from heatertune.proof import Actuator
from heatertune.proof.period import propose_period

__all__ = ["with_pwm"]

_OF_TOLERANCE = 0.2  # ripple, peak to peak: a fifth of the half band leaves the rest to the loop


def with_pwm(
    design: PidDesign, fitted: FittedModel, kind: str, *, words: Words | None = None,
    setpoint_degC: float | None = None, tolerance_degC: float = 1.0,
) -> tuple[PidDesign, Actuator | None]:
    """Return the design with a note on the PWM period, and the switch with that period.

    No switch where the target makes the PWM itself, with TA as its period: there is nothing to choose.

    Args:
        design: what was tuned.
        fitted: the heater and its candidates.
        kind: "relay" or "ssr".
        words: what the controller will hold; None: a switch behind its output.
        setpoint_degC: where the loop rests [°C]; None: as the proof takes it.
        tolerance_degC: half width of the band that is right [°C]; the ripple may take a fifth of it.

    Raises:
        UnknownName: no such kind of switch.
    """
    wanted = propose_period(
        fitted.plants, kind=kind, sample_time_s=design.sample_time_s, ambient_degC=ROOM_DEGC,
        setpoint_degC=default_setpoint(fitted) if setpoint_degC is None else setpoint_degC,
        ripple_degC_most=_OF_TOLERANCE * tolerance_degC,
    )
    if words is not None and (own := controller_for(words.target).timing(words).pwm_period_s) is not None:
        note = f"{words.target} makes the PWM itself, period {own:g} s; a switch behind it would get: {wanted.told}"
        return replace(design, notes=(*design.notes, note)), None
    return replace(design, notes=(*design.notes, wanted.told)), Actuator(
        pwm_period_s=wanted.period_s, resolution_s=min(0.01, wanted.period_s))
