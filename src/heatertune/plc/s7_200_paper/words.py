"""The printed program's constants."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from heatertune.errors import NotRepresentable
from heatertune.pid.design_values import PidDesign
from heatertune.plc.cpu.s7_200.io_and_cycle import MOST, ms_per_count, whole_cycle
from heatertune.plc.ramp import Number
from heatertune.plc.words import Scaling, WordField, Words

__all__ = ["FIELDS", "cycle_s", "paper_words", "values_of"]

_HIGH_BYTE: Final = 256  # errors stand in the high byte of their words
_CYCLE_STEP: Final = 100  # ms

FIELDS: Final[tuple[WordField, ...]] = (
    WordField(name="KP", address="network 6", format="INT", low=-MOST, high=MOST, comment="Kp: accumulates, acts as I"),
    WordField(name="KI", address="network 6", format="INT", low=-MOST, high=MOST, comment="Ki: acts as I, trapezoidal"),
    WordField(name="KD", address="network 6", format="INT", low=-MOST, high=MOST, comment="Kd: acts as P"),
    WordField(name="T", address="network 6", format="INT", low=1, high=MOST, comment="T: factor of Ki, divisor of Kd"),
    WordField(name="CYCLE", address="SMW68", format="INT", low=2, high=MOST, comment="PWM cycle, ms"),
    WordField(name="POT1", address="SMB29", format="BYTE", low=0, high=255, comment="low byte of the error"),
)


def values_of(design: PidDesign, scaling: Scaling) -> dict[str, float]:
    """Return the constants that the paper's equation asks for, T = 1 PWM cycle; the program makes no PID of them.

    The PWM cycle is TA or, where the constants would not be words, the longest shorter one in tenths of a second.

    Raises:
        NotRepresentable: a constant that is no word at any cycle.
    """
    longest = whole_cycle(design.sample_time_s)
    for cycle in range(longest, 0, -_CYCLE_STEP):
        exact = _constants(design, scaling, cycle)
        if max(map(abs, exact.values())) <= MOST:
            return exact | {"T": 1, "CYCLE": cycle, "POT1": 0}
    name, value = max(exact.items(), key=lambda pair: abs(pair[1]))
    raise NotRepresentable(f"constant {name}", value, f"up to {MOST}", "a smaller K would fit")


def _constants(design: PidDesign, scaling: Scaling, cycle: int) -> dict[str, float]:
    gain = _HIGH_BYTE * ms_per_count(scaling, cycle) * design.gain_pct_per_degC
    seconds = cycle / 1000.0
    half = gain * seconds / design.integral_time_s / 2.0
    return {"KP": gain, "KI": half, "KD": gain * design.derivative_time_s / seconds}


def cycle_s(values: Mapping[str, Number]) -> float:
    """Return the PWM cycle [s]."""
    return values["CYCLE"] / 1000.0


def paper_words(*, gain: int, ki: int = 0, t: int = 1, cycle_ms: int = 2000, scaling: Scaling | None = None) -> Words:
    """Return the constants of a run of the paper.

    The paper gives the gain (20, 60) and no more: the rest are assumptions.

    Args:
        gain: constant Kp.
        ki: constant Ki.
        t: constant T.
        cycle_ms: PWM cycle [ms].
        scaling: sensor range; None: 0…140 °C.
    """
    values = {"KP": gain, "KI": ki, "KD": 0, "T": t, "CYCLE": cycle_ms, "POT1": 0}
    scaling = scaling or Scaling(low_degC=0.0, high_degC=140.0)
    return Words(target="s7-200-paper", values=values, scaling=scaling, sample_time_s=cycle_ms / 1000.0)
