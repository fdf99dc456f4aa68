"""The words of simple-pid: the arguments of its class PID, and the interval of the loop that calls it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from heatertune.pid.values import PidDesign, Timer
from heatertune.plc.parallel.words import design_from, gain_field, gains_of, oddities_of
from heatertune.plc.ramp import Number
from heatertune.plc.words import Scaling, WordField, Words

__all__ = ["COUNTS", "FIELDS", "FULL", "GAINS", "TIMER", "design_of", "interval_s", "oddities", "values_of"]

#: of the 12-bit converter behind the sensor that is assumed
COUNTS: Final = 4095
#: output of full power
FULL: Final = 100.0
TIMER: Final = Timer(shortest_s=0.01, longest_s=600.0, step_s=0.01)

GAINS: Final = (
    gain_field("Kp", "PID", "LREAL", "proportional gain, % per °C"),
    gain_field("Ki", "PID", "LREAL", "integral gain Kp/TN, per second"),
    gain_field("Kd", "PID", "LREAL", "derivative gain Kp·TV, seconds"),
)


def _switch(name: str) -> WordField:
    return WordField(name=name, address="PID", format="BYTE", low=0, high=1, comment="1 True, 0 False")


FIELDS: Final[tuple[WordField, ...]] = (
    *GAINS,
    WordField(name="output_max", address="output_limits", format="LREAL", low=0.001, high=FULL,
              comment="upper limit of the output, %; the lower one is 0"),
    _switch("proportional_on_measurement"),
    _switch("differential_on_measurement"),
    WordField(name="PERIOD_MS", address="loop", format="TIME", low=10, high=600000,
              comment="interval of the calls, ms"),
)


def values_of(design: PidDesign, scaling: Scaling) -> dict[str, Number]:  # noqa: ARG001 - in °C
    """Return the words of a design.

    Raises:
        NotRepresentable: as `gains_of`.
    """
    return gains_of(design, GAINS, FULL) | {
        "output_max": FULL, "proportional_on_measurement": 0, "differential_on_measurement": 1,
        "PERIOD_MS": round(1000.0 * design.sample_time_s)}


def design_of(words: Words) -> PidDesign | None:
    """Return the design that these words run; None with P on the measurement, which is no standard form.

    Raises:
        OutOfRange: as `design_from`.
    """
    v = words.values
    if v["proportional_on_measurement"]:
        return None
    return design_from(words, (v["Kp"], v["Ki"], v["Kd"]), FULL, "as the words of simple-pid realise it")


def oddities(words: Words) -> tuple[str, ...]:
    """Return what is odd about a program's words, one sentence each."""
    v = words.values
    checks = [
        (v["proportional_on_measurement"] == 1,
         "P is on the measurement: it is no standard form, and its sum has no limits."),
        (v["differential_on_measurement"] == 0, "D is on the error: a step of the setpoint kicks the output."),
        (v["output_max"] < FULL, f"The output is limited to {v['output_max']:g} %."),
    ]
    return (*oddities_of(v), *(sentence for odd, sentence in checks if odd))


def interval_s(values: Mapping[str, Number]) -> float:
    """Return the interval of the calls [s]."""
    return values["PERIOD_MS"] / 1000.0
