"""What the words of the controllers in the parallel form share: gains, their text, and the way back to a design.

Text of programs: numbers as C and YAML write them, and comments put out of the way.
"""

from __future__ import annotations

import math
import re
from collections.abc import Mapping
from decimal import Decimal
from typing import Final

from heatertune.errors import NotRepresentable, OutOfRange
from heatertune.pid.values import PidDesign, structure_of
from heatertune.plc.ramp import Number
from heatertune.plc.single_precision import single
from heatertune.plc.words import WordField, Words, round_to_word

__all__ = [
    "MOST_GAIN", "blank_matches", "decimal", "design_from", "gain_field", "gains_of", "number_of", "oddities_of",
]


_NUMBER: Final = re.compile(r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?[fFlL]?", re.ASCII)


def number_of(text: str) -> float | None:
    """Return a decimal number in double precision, None where it is none or has no end."""
    plain = text.strip()
    if not _NUMBER.fullmatch(plain):
        return None
    value = float(plain.rstrip("fFlL"))
    return value if math.isfinite(value) else None


def blank_matches(pattern: re.Pattern[str], text: str) -> str:
    """Return a text with blanks for what a pattern matches, line for line."""
    return pattern.sub(lambda match: re.sub(r"[^\n]", " ", match[0]), text)


#: largest gain that is taken as one, in the controller's units
MOST_GAIN: Final = 1e9

_DIGITS: Final = 9  # of a single, so that none is another's


def gain_field(name: str, address: str, format_: str, comment: str) -> WordField:
    """Return the field of a gain, which is not negative."""
    return WordField(name=name, address=address, format=format_, low=0.0, high=MOST_GAIN, comment=comment)


def gains_of(design: PidDesign, fields: tuple[WordField, WordField, WordField], full: float) -> dict[str, Number]:
    """Return Kp, Ki = Kp/TN and Kd = Kp·TV of a design.

    Args:
        design: of a heater.
        fields: of the three gains.
        full: output at 100 % power.

    Raises:
        NotRepresentable: a cooler, whose gain is negative; a gain out of its range or rounded to zero.
    """
    if design.gain_pct_per_degC < 0.0:
        raise NotRepresentable("gain", design.gain_pct_per_degC, "positive: these words are of a heater",
                               "a target whose words have a sign or a direction would fit")
    kp, tn = design.gain_pct_per_degC * full / 100.0, design.integral_time_s
    exact = (kp, 0.0 if math.isinf(tn) else kp / tn, kp * design.derivative_time_s)
    return {field.name: round_to_word(field, value) for field, value in zip(fields, exact, strict=True)}


def design_from(
    words: Words, gains: tuple[Number, Number, Number], full: float, method: str, derivative_filter: float = 0.0
) -> PidDesign:
    """Return the design that gains run.

    Args:
        words: for the sampling interval.
        gains: Kp, Ki and Kd.
        full: output at 100 % power.
        method: of the design.
        derivative_filter: see `PidDesign`.

    Raises:
        OutOfRange: Kp = 0, or gains so far apart that TN or TV is none; they have no standard form.
    """
    kp, ki, kd = map(float, gains)
    if kp == 0.0:
        raise OutOfRange("word Kp", kp, "not 0: the standard form needs a P part")
    tn, tv, gain = math.inf if ki == 0.0 else kp / ki, kd / kp, 100.0 * kp / full
    if tn == 0.0 or math.isinf(tv) or gain == 0.0 or (math.isinf(tn) and ki != 0.0):
        raise OutOfRange("word Kp", kp, f"of the size of Ki = {ki:g} and Kd = {kd:g}")
    return PidDesign(
        gain_pct_per_degC=gain, integral_time_s=tn, derivative_time_s=tv, sample_time_s=words.sample_time_s,
        structure=structure_of(tn, tv), method=method, derivative_filter=derivative_filter)


def oddities_of(gains: Mapping[str, Number]) -> list[str]:
    """Return what is odd about Kp and Ki, one sentence each."""
    checks = [(gains["Kp"] == 0.0, "Kp is 0: there is no proportional part."),
              (gains["Ki"] == 0.0, "Ki is 0: there is no integral part, and an offset remains.")]
    return [sentence for odd, sentence in checks if odd]


def decimal(value: Number, format_: str) -> str:
    """Return a number in plain decimals, as few as no other of its format has; no exponent, one decimal at least.

    Some of the parsers that read it (Marlin's of G-code) end a number at an E.
    """
    text = repr(float(value))
    if format_ == "REAL":
        texts = (f"{value:.{digits}g}" for digits in range(1, _DIGITS + 1))
        text = next(each for each in texts if single(float(each)) == value)
    plain = format(Decimal(text), "f")
    return plain if "." in plain else f"{plain}.0"
