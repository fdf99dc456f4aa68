"""The words of Marlin's PID (Configuration.h, M301): gains in units of 255, and what the firmware was built with."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from heatertune.pid.values import PidDesign, Timer
from heatertune.plc.parallel.words import design_from, gain_field, gains_of, oddities_of
from heatertune.plc.ramp import Number
from heatertune.plc.single_precision import single
from heatertune.plc.words import Scaling, WordField, Words

__all__ = ["COUNTS", "FIELDS", "FULL", "GAINS", "LEAST_LOOPS", "LOOP_S", "TIMER", "USUAL", "design_of", "interval_s",
           "oddities", "values_of"]

#: of the converter of 10 bits; the sum of 16 readings is finer where they differ
COUNTS: Final = 1023
#: output of full power before it is halved
FULL: Final = 255.0
#: 16 samples of a timer of 1000 Hz [s]
LOOP_S: Final = 0.016
LEAST_LOOPS: Final = 10
_MOST_LOOPS: Final = 16
#: PID_dT of a build with few sensors; those of others are read, not designed: no word of a running firmware changes it
TIMER: Final = Timer(shortest_s=LEAST_LOOPS * LOOP_S, longest_s=LEAST_LOOPS * LOOP_S, step_s=LOOP_S)

GAINS: Final = (
    gain_field("Kp", "M301, M304 P", "REAL", "proportional gain, 1/255 of full power per °C"),
    gain_field("Ki", "M301, M304 I", "REAL", "integral gain Kp/TN, per second"),
    gain_field("Kd", "M301, M304 D", "REAL", "derivative gain Kp·TV, seconds"),
)

FIELDS: Final[tuple[WordField, ...]] = (
    *GAINS,
    WordField(name="PID_MAX", address="Configuration.h", format="BYTE", low=1, high=255,
              comment="upper limit of the output, of 255"),
    WordField(name="PID_FUNCTIONAL_RANGE", address="Configuration.h", format="BYTE", low=1, high=255,
              comment="farther from the setpoint than this, °C, the heater is full on or off and I is reset"),
    WordField(name="PID_K1", address="Configuration.h", format="REAL", low=0.0, high=single(0.999),
              comment="weight of its own past in the derivative part"),
    WordField(name="ADC_LOOPS", address="ACTUAL_ADC_SAMPLES", format="BYTE", low=LEAST_LOOPS, high=_MOST_LOOPS,
              comment="states of the sensor reading, 10 or more: PID_dT is 16 of each"),
)

#: what a firmware has that nobody changed
USUAL: Final[dict[str, Number]] = {
    "PID_MAX": 255, "PID_FUNCTIONAL_RANGE": 10, "PID_K1": single(0.95), "ADC_LOOPS": LEAST_LOOPS,
}


def values_of(design: PidDesign, scaling: Scaling) -> dict[str, Number]:  # noqa: ARG001 - in °C
    """Return the words of a design.

    Raises:
        NotRepresentable: as `gains_of`.
    """
    return gains_of(design, GAINS, FULL) | USUAL | {"ADC_LOOPS": round(design.sample_time_s / LOOP_S)}


def design_of(words: Words) -> PidDesign:
    """Return the design that these words run.

    Raises:
        OutOfRange: as `design_from`.
    """
    v = words.values
    return design_from(words, (v["Kp"], v["Ki"], v["Kd"]), FULL, "as Marlin's words realise it",
                       derivative_filter=float(v["PID_K1"]))


def interval_s(values: Mapping[str, Number]) -> float:
    """Return PID_dT with a timer of 1000 Hz [s]."""
    return round(values["ADC_LOOPS"] * LOOP_S, 3)


def oddities(words: Words) -> tuple[str, ...]:
    """Return what is odd about a firmware's words, one sentence each."""
    v = words.values
    changed = [f"{name} is {v[name]:g}, not {usual:g}." for name, usual in USUAL.items()
               if name != "ADC_LOOPS" and v[name] != usual]
    return (*oddities_of(v), *changed)
