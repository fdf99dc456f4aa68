"""Rules read from the ultimate cycle (Ku, Pu), which the model gives exactly: no experiment, no Padé."""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Final

from heatertune.errors import OutOfRange
from heatertune.model.values import HeaterModel
from heatertune.pid.forms import Settings
from heatertune.pid.rules.values import Formula, Rule

__all__ = ["ULTIMATE", "ultimate_cycle"]


def ultimate_cycle(model: HeaterModel) -> tuple[float, float]:
    """Return Ku [%/°C] and Pu [s]: the P gain at which the loop swings for ever, and the period of that swing.

    The phase ω·L + Σ atan(ω·T) = π has one root below π/L, as it rises with ω. It bends down, so Newton's method comes
    to the root from below.

    Raises:
        OutOfRange: no dead time: one or two lags alone never reach −180°.
    """
    dead = model.dead_time_s
    if dead <= 0.0:
        raise OutOfRange("dead_time_s", dead, "> 0: without dead time no P gain makes the loop swing for ever")

    def lacking(angle: float) -> float:
        return angle + sum(math.atan(angle * lag / dead) for lag in model.lags_s) - math.pi

    angle, last = 0.0, -1.0
    while angle > last:
        slope = 1.0 + sum(lag * dead / (dead**2 + (angle * lag) ** 2) for lag in model.lags_s)
        angle, last = angle - lacking(angle) / slope, angle
    omega = last / dead
    size = math.prod(math.hypot(1.0, omega * lag) for lag in model.lags_s)
    return size / model.gain_degC_per_pct, 2.0 * math.pi / omega


def _from_cycle(formula: Callable[[float, float], Settings]) -> Formula:
    """Return a formula in Ku and Pu as one that takes a model."""

    def applied(model: HeaterModel, wanted_s: float | None) -> Settings:  # noqa: ARG001 - leaves nothing open
        return formula(*ultimate_cycle(model))

    return applied


ULTIMATE: Final[dict[str, Rule]] = {
    "ziegler-nichols-ultimate": Rule(
        source="J. G. Ziegler and N. B. Nichols, Trans. ASME 64 (1942) 759–768, ultimate sensitivity",
        formulas={
            "p": _from_cycle(lambda Ku, Pu: (0.5 * Ku, math.inf, 0.0)),  # noqa: ARG005 - Pu plays no part
            "pi": _from_cycle(lambda Ku, Pu: (0.45 * Ku, Pu / 1.2, 0.0)),
            "pid": _from_cycle(lambda Ku, Pu: (0.6 * Ku, Pu / 2.0, Pu / 8.0)),
        },
        claim="each swing a quarter of the one before",
        errata=("A textbook prints 0.4·Ku and 0.8·Pu for PI.",),
    ),
    "tyreus-luyben": Rule(
        source="B. D. Tyreus and W. L. Luyben, Ind. Eng. Chem. Res. 31 (1992) 2625–2628 (PI); "
        "W. L. Luyben, Ind. Eng. Chem. Res. 35 (1996) 3480–3483 (PID)",
        formulas={
            "pi": _from_cycle(lambda Ku, Pu: (0.31 * Ku, 2.2 * Pu, 0.0)),
            "pid": _from_cycle(lambda Ku, Pu: (0.46 * Ku, 2.2 * Pu, Pu / (2.0 * math.pi))),
        },
        form="series",
        claim="Mt of 2 dB (1.26) where the lag acts as an integrator",
        errata=(
            "Textbooks round the gains to Ku/3.2 and Ku/2.2, and TV = 1/ωu to Pu/6.3; a copy gives PID the gain of PI.",
            "The PID rule is for the series form; most copies print it without saying so.",
        ),
    ),
}
