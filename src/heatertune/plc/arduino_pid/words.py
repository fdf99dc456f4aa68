"""The words of PID_v1: what its constructor, SetOutputLimits and SetSampleTime are given."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from heatertune.errors import OutOfRange
from heatertune.pid.values import PidDesign, Timer
from heatertune.plc.parallel.words import design_from, gain_field, gains_of, oddities_of
from heatertune.plc.ramp import Number
from heatertune.plc.words import Scaling, WordField, Words

__all__ = ["COUNTS", "FIELDS", "FULL", "GAINS", "ON_ERROR", "ON_MEASUREMENT", "TIMER", "consistent", "design_of",
           "interval_s", "oddities", "values_of"]

#: of the 12-bit converter behind the sensor that is assumed
COUNTS: Final = 4095
#: output of full power, the library's own upper limit
FULL: Final = 255.0
#: POn, as PID_v1.h numbers them
ON_MEASUREMENT: Final = 0
ON_ERROR: Final = 1
#: SampleTime is an int of ms, which has 16 bits on an AVR
TIMER: Final = Timer(shortest_s=0.001, longest_s=32.767, step_s=0.001)

GAINS: Final = (
    gain_field("Kp", "constructor", "LREAL", "proportional gain, output per °C"),
    gain_field("Ki", "constructor", "LREAL", "integral gain Kp/TN, per second"),
    gain_field("Kd", "constructor", "LREAL", "derivative gain Kp·TV, seconds"),
)

FIELDS: Final[tuple[WordField, ...]] = (
    *GAINS,
    WordField(name="POn", address="constructor", format="BYTE", low=0, high=1, comment="1 P_ON_E, 0 P_ON_M"),
    WordField(name="OutMax", address="SetOutputLimits", format="LREAL", low=0.001, high=65535.0,
              comment="upper limit of the output; the lower one is 0"),
    WordField(name="Full", address="sketch", format="LREAL", low=0.001, high=65535.0, comment="output at full power"),
    WordField(name="SampleTime", address="SetSampleTime", format="UINT", low=1, high=32767, comment="ms"),
)


def values_of(design: PidDesign, scaling: Scaling) -> dict[str, Number]:  # noqa: ARG001 - in °C
    """Return the words of a design, P on the error.

    Raises:
        NotRepresentable: as `gains_of`.
    """
    return gains_of(design, GAINS, FULL) | {
        "POn": ON_ERROR, "OutMax": FULL, "Full": FULL, "SampleTime": round(1000.0 * design.sample_time_s)}


def design_of(words: Words) -> PidDesign | None:
    """Return the design that these words run; None with P on the measurement, which is no standard form.

    Raises:
        OutOfRange: as `design_from`.
    """
    v = words.values
    if v["POn"] == ON_MEASUREMENT:
        return None
    return design_from(words, (v["Kp"], v["Ki"], v["Kd"]), float(v["Full"]), "as the words of PID_v1 realise it")


def consistent(words: Words) -> None:
    """Refuse words that contradict one another.

    Raises:
        OutOfRange: an upper limit above full power.
    """
    v = words.values
    if v["OutMax"] > v["Full"]:
        raise OutOfRange("word OutMax", v["OutMax"], f"<= Full = {v['Full']:g}")


def oddities(words: Words) -> tuple[str, ...]:
    """Return what is odd about a sketch's words, one sentence each."""
    v = words.values
    checks = [
        (v["POn"] == ON_MEASUREMENT, "P is on the measurement (P_ON_M): that is no standard form."),
        (v["OutMax"] < v["Full"], f"The output is limited to {v['OutMax']:g} of {v['Full']:g}."),
    ]
    return (*oddities_of(v), *(sentence for odd, sentence in checks if odd))


def interval_s(values: Mapping[str, Number]) -> float:
    """Return SampleTime [s]."""
    return values["SampleTime"] / 1000.0
