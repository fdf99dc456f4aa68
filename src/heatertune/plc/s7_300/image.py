"""The tip's instance data block as a running CPU holds it."""

from __future__ import annotations

import math
from typing import Final

from heatertune.plc.controller import Scaling, Words
from heatertune.plc.cpu.s7_300 import memory
from heatertune.plc.s7_300.words import FIELDS, check_words

__all__ = ["from_image", "oddities"]

_WRONG_CLOCK: Final = 1e-6
#: times that no heater needs [ms]: a day, and less than a tenth of a call
_DAY: Final = 86_400_000.0


def from_image(image: bytes, *, sample_time_s: float, scaling: Scaling, source: str = "DB") -> Words:
    """Return the words of a dumped instance data block.

    Args:
        image: at least 26 bytes; what follows belongs to the block.
        sample_time_s: interval at which the block is called [s], whatever SAMPLE says.
        scaling: sensor range; the block does not hold it.
        source: name for error messages.

    Raises:
        InputError: fewer than 26 bytes.
        OutOfRange: a word outside its range. An infinite RESET is read as 0: the document means the same by both.
    """
    values = memory.read(image, FIELDS, source)
    if values["RESET"] == math.inf:
        values["RESET"] = 0.0
    words = Words(target="s7-300", values=values, scaling=scaling, sample_time_s=sample_time_s)
    check_words(words)
    return words


def oddities(words: Words) -> tuple[str, ...]:
    """Return what is odd about a controller's words, one sentence each."""
    v, called = words.values, 1000.0 * words.sample_time_s
    found = []
    if abs(v["SAMPLE"] - called) > _WRONG_CLOCK * called:
        found.append(f"SAMPLE is {v['SAMPLE']:g} ms, but the block is called every {called:g} ms: TN and TV are "
                     f"{called / v['SAMPLE']:.3g} times what RESET and RATE say.")
    if v["GAIN"] == 0.0:
        found.append("GAIN is 0: no proportional part; the integral and derivative parts act with a gain of 1.")
    elif v["GAIN"] < 0.0:
        found.append("GAIN is negative: the output falls where the temperature is too low, as for a cooler.")
    if v["RESET"] == 0.0:
        found.append("RESET is 0 (or infinite): the controller has no integral part.")
    elif not v["SAMPLE"] <= v["RESET"] <= _DAY:
        found.append(f"RESET is {v['RESET']:g} ms: shorter than one call or longer than a day; is it in ms?")
    if v["RATE"] and not v["SAMPLE"] / 10.0 <= v["RATE"] <= _DAY:
        found.append(f"RATE is {v['RATE']:g} ms: shorter than a tenth of a call or longer than a day; is it in ms?")
    return tuple(found)
