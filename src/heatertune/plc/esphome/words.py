"""The words of ESPHome's PID climate: control_parameters, and the interval of the sensor that calls it."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from heatertune.errors import OutOfRange
from heatertune.pid.values import PidDesign, Timer
from heatertune.plc.parallel.words import design_from, gain_field, gains_of, oddities_of
from heatertune.plc.ramp import Number
from heatertune.plc.words import Scaling, WordField, Words

__all__ = ["COUNTS", "FIELDS", "FULL", "GAINS", "MOST_SAMPLES", "TIMER", "consistent", "design_of", "interval_s",
           "oddities", "values_of"]

#: of the 12-bit converter behind the sensor that is assumed
COUNTS: Final = 4095
#: level of full power
FULL: Final = 1.0
MOST_SAMPLES: Final = 8
TIMER: Final = Timer(shortest_s=0.1, longest_s=65.5, step_s=0.1)

GAINS: Final = (
    gain_field("kp", "control_parameters", "REAL", "proportional gain, level 0…1 per °C"),
    gain_field("ki", "control_parameters", "REAL", "integral gain kp/TN, per second"),
    gain_field("kd", "control_parameters", "REAL", "derivative gain kp·TV, seconds"),
)

FIELDS: Final[tuple[WordField, ...]] = (
    *GAINS,
    WordField(name="min_integral", address="control_parameters", format="REAL", low=-1.0, high=1.0,
              comment="lower limit of the integral part"),
    WordField(name="max_integral", address="control_parameters", format="REAL", low=-1.0, high=1.0,
              comment="upper limit of the integral part"),
    WordField(name="derivative_averaging_samples", address="control_parameters", format="BYTE", low=1,
              high=MOST_SAMPLES, comment="changes of the reading whose mean the derivative part takes"),
    WordField(name="update_interval", address="sensor", format="UINT", low=1, high=65535,
              comment="ms; each reading calls the PID"),
)


def values_of(design: PidDesign, scaling: Scaling) -> dict[str, Number]:  # noqa: ARG001 - in °C
    """Return the words of a design; the integral part is limited to what the heater can give.

    Raises:
        NotRepresentable: as `gains_of`.
    """
    return gains_of(design, GAINS, FULL) | {
        "min_integral": 0.0, "max_integral": 1.0, "derivative_averaging_samples": 1,
        "update_interval": round(1000.0 * design.sample_time_s)}


def design_of(words: Words) -> PidDesign:
    """Return the design that these words run; a mean over n changes stands for the filter of the same mean delay.

    Raises:
        OutOfRange: as `design_from`.
    """
    v = words.values
    samples = v["derivative_averaging_samples"]
    return design_from(words, (v["kp"], v["ki"], v["kd"]), FULL, "as ESPHome's words realise it",
                       derivative_filter=(samples - 1) / (samples + 1))


def consistent(words: Words) -> None:
    """Refuse words that contradict one another.

    Raises:
        OutOfRange: limits that are upside down.
    """
    v = words.values
    if v["min_integral"] > v["max_integral"]:
        raise OutOfRange("word min_integral", v["min_integral"], f"<= max_integral = {v['max_integral']:g}")


def oddities(words: Words) -> tuple[str, ...]:
    """Return what is odd about a climate's words, one sentence each."""
    v = words.values
    samples = v["derivative_averaging_samples"]
    checks = [
        (v["min_integral"] < 0.0, f"min_integral is {v['min_integral']:g}: below 0 I only delays the heater."),
        (v["max_integral"] < 1.0, f"max_integral is {v['max_integral']:g}: the integral part cannot give full power."),
        (samples > 1, f"The derivative part is the mean of {samples} changes."),
    ]
    return (*oddities_of({"Kp": v["kp"], "Ki": v["ki"]}), *(sentence for odd, sentence in checks if odd))


def interval_s(values: Mapping[str, Number]) -> float:
    """Return update_interval [s]."""
    return values["update_interval"] / 1000.0
