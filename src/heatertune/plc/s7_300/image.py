"""The tip's instance data block as a running CPU holds it."""

from __future__ import annotations

import math
from typing import Final

from heatertune.plc.cpu.s7_300 import memory
from heatertune.plc.ramp import Number
from heatertune.plc.s7_300.words import FIELDS
from heatertune.plc.words import Words

__all__ = ["from_image", "oddities"]

_WRONG_CLOCK: Final = 1e-6
#: times that no heater needs [ms]: a day, and less than a tenth of a call
_DAY: Final = 86_400_000.0


def from_image(image: bytes, _sample_time_s: float, source: str) -> dict[str, Number]:
    """Return the values in a dumped instance data block of at least 26 bytes; what follows belongs to the block.

    An infinite RESET is read as 0: the document means the same by both.

    Raises:
        InputError: fewer than 26 bytes.
    """
    values = memory.read(image, FIELDS, source)
    if values["RESET"] == math.inf:
        values["RESET"] = 0.0
    return values


def oddities(words: Words) -> tuple[str, ...]:
    """Return what is odd about a controller's words, one sentence each."""
    v, called = words.values, 1000.0 * words.sample_time_s
    odd = []
    if abs(v["SAMPLE"] - called) > _WRONG_CLOCK * called:
        odd.append(f"SAMPLE is {v['SAMPLE']:g} ms, but the block is called every {called:g} ms: TN and TV are "
                   f"{called / v['SAMPLE']:.3g} times what RESET and RATE say.")
    if v["GAIN"] == 0.0:
        odd.append("GAIN is 0: no proportional part; the integral and derivative parts act with a gain of 1.")
    elif v["GAIN"] < 0.0:
        odd.append("GAIN is negative: the output falls where the temperature is too low, as for a cooler.")
    if v["RESET"] == 0.0:
        odd.append("RESET is 0 (or infinite): the controller has no integral part.")
    elif not v["SAMPLE"] <= v["RESET"] <= _DAY:
        odd.append(f"RESET is {v['RESET']:g} ms: shorter than one call or longer than a day; is it in ms?")
    if v["RATE"] and not v["SAMPLE"] / 10.0 <= v["RATE"] <= _DAY:
        odd.append(f"RATE is {v['RATE']:g} ms: shorter than a tenth of a call or longer than a day; is it in ms?")
    return tuple(odd)
