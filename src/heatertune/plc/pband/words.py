"""The words of a make: proportional band, times and cycle time in its own digits, and back.

    K [%/°C] = 100/PB[°C], or 100/(PB% · span/100)        TN = Ti        TV = Td

Roles in the table: band and band% the proportional band [°C] or [% of the span], ti and td the times, ti7201 a Ti that
is off at 7201, cycle the PWM period, high the upper limit of the output, least a band of power without pulses, alpha
the setpoint filter's, approach how far the derivative acts, cutback one proportional band, unit that of the times,
fixed whatever always stands there.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Final

from heatertune.errors import NotRepresentable, OutOfRange
from heatertune.pid.design_values import PidDesign, structure_of
from heatertune.plc.pband.makes import OFF_7201, TIME_UNIT, Entry, Make
from heatertune.plc.pband.step import PbandAssumptions, PbandBlock
from heatertune.plc.ramp import Number
from heatertune.plc.single_precision import single
from heatertune.plc.words import Scaling, Words, round_half_away

__all__ = [
    "COUNTS", "LAG_PARTS", "band_degC", "block_of", "by_role", "consistent", "design_of", "display_text", "entry_value",
    "oddities", "period_of", "periods_of", "places", "values_of", "with_period",
]

#: steps of the reading over the sensor's range: finer than a display of four digits, see the switch `reading`
COUNTS: Final = 10_000
#: the derivative's lag is TV by this
LAG_PARTS: Final = 8.0

#: α of a 2-PID whose words have none: Omron's factory setting
_ALPHA: Final = 0.65
_OF_TN: Final = 20.0  # the cycle time is at the most a twentieth of TN, so that the pulses are no part of the loop
_USUAL_S: Final = 2.0  # [s] where TN asks for no shorter one: a solid-state relay's
_LONGEST_S: Final = 100.0


def by_role(make: Make, role: str) -> Entry | None:
    """Return the entry of a role, None where the make has none."""
    return next((entry for entry in make.entries if entry.role == role), None)


def entry_value(entry: Entry, number: Number) -> float:
    """Return the value of a written number, in the unit of its entry."""
    return float(number) if entry.real else number / 10.0**entry.decimals


def places(entry: Entry, values: Mapping[str, Number]) -> int:
    """Return how many decimal places the display shows: of a time one more where it is in tenths of a second."""
    return entry.decimals + (int(values.get(TIME_UNIT, 0)) if entry.role in ("ti", "td") else 0)


def display_text(entry: Entry, values: Mapping[str, Number]) -> str:
    """Return a word as the display has it, with its decimal point."""
    number, decimals = values[entry.name], places(entry, values)
    if not entry.real:
        return f"{number / 10.0**decimals:.{decimals}f}"
    text = f"{number:.{decimals}f}"
    return text if single(float(text)) == number else f"{number:.9g}"


def _written(entry: Entry, value: float) -> Number:
    """Return a value as it is written: to the digits that can be typed in, halves away from zero."""
    digits = round_half_away(value * 10.0**entry.decimals)
    return single(digits / 10.0**entry.decimals) if entry.real else digits


def band_degC(make: Make, values: Mapping[str, Number], span_degC: float) -> float:
    """Return the proportional band [°C]."""
    entry = by_role(make, "band")
    if entry is not None:
        return entry_value(entry, values[entry.name])
    share = next(entry for entry in make.entries if entry.role == "band%")
    return entry_value(share, values[share.name]) * span_degC / 100.0


def values_of(make: Make, design: PidDesign, scaling: Scaling) -> dict[str, Number]:
    """Return all words of a design.

    Raises:
        NotRepresentable: a cooler; a band or time that leaves its range, or a time that would be rounded to none.
    """
    gain = design.gain_pct_per_degC
    if gain < 0.0:
        raise NotRepresentable("gain", gain, "positive: the instrument is set to heat (reverse action)",
                               "a heater would fit")
    band = 100.0 / gain
    unit = _time_unit(make, design)
    values: dict[str, Number] = {}
    for entry in make.entries:
        if entry.role in ("band", "cutback"):
            value = band
        elif entry.role == "band%":
            value = 100.0 * band / scaling.span_degC
        elif entry.role in ("ti", "ti7201"):
            value = design.integral_time_s * 10.0**unit if math.isfinite(design.integral_time_s) else 0.0
        elif entry.role == "td":
            value = design.derivative_time_s * 10.0**unit
        else:
            values[entry.name] = _set(make, entry, design, unit)
            continue
        values[entry.name] = _checked(entry, value)
    return values


def _time_unit(make: Make, design: PidDesign) -> int:
    """Return 1 where both times are in tenths of a second by a word of their own, 0 where they are as they are."""
    if not any(entry.name == TIME_UNIT for entry in make.entries):
        return 0
    times = [time for time in (design.integral_time_s, design.derivative_time_s) if math.isfinite(time)]
    return int(max(times) < 999.95)


def _set(make: Make, entry: Entry, design: PidDesign, unit: int) -> Number:
    """Return a word that no gain or time is in."""
    if entry.role == "cycle":
        longest = min(_USUAL_S, design.integral_time_s / _OF_TN)
        periods = periods_of(make, longest) or periods_of(make)[:1]
        return periods[-1][0]
    if entry.role == "unit":
        return unit
    if entry.role == "high":
        return _written(entry, 100.0)
    assert entry.fixed is not None
    return single(float(entry.fixed)) if entry.real else entry.fixed


def _checked(entry: Entry, value: float) -> Number:
    """Return a band or a time as it is written; raise NotRepresentable where it does not fit."""
    word = _written(entry, value)
    if entry.role == "ti7201":
        if value == 0.0:
            return OFF_7201
        if not entry.low <= word < OFF_7201:
            raise NotRepresentable(f"word {entry.name}", word, "1…7200 s", "a TN within it would fit")
        return word
    if word == 0 and value > 0.0 and entry.role in ("ti", "td"):
        least = 10.0**-entry.decimals
        raise NotRepresentable(f"word {entry.name}", value, f"{least:g}…{entry.high / 10.0**entry.decimals:g}",
                               "a longer time, or none, would fit")
    if not entry.low <= word <= entry.high:
        low, high = (end if entry.real else end / 10.0**entry.decimals for end in (entry.low, entry.high))
        raise NotRepresentable(f"word {entry.name}", entry_value(entry, word), f"{low:g}…{high:g} {entry.unit}",
                               "another design would fit")
    return word


def design_of(make: Make, words: Words) -> PidDesign:
    """Return the design that words run, with the derivative's lag at a sampling interval of theirs."""
    values, ta = words.values, words.sample_time_s
    tn, tv = _times(make, values)
    return PidDesign(
        gain_pct_per_degC=100.0 / band_degC(make, values, words.scaling.span_degC), integral_time_s=tn,
        derivative_time_s=tv, sample_time_s=ta, structure=structure_of(tn, tv),
        method="as the instrument's parameters realise it", derivative_filter=tv / (tv + LAG_PARTS * ta))


def _times(make: Make, values: Mapping[str, Number]) -> tuple[float, float]:
    """Return TN, infinite where there is no I part, and TV [s]."""
    unit = 10.0 ** values.get(TIME_UNIT, 0)
    times = {entry.role: entry_value(entry, values[entry.name]) / unit for entry in make.entries
             if entry.role in ("ti", "ti7201", "td")}
    tn = times.get("ti", times.get("ti7201", 0.0))
    return (math.inf if tn == 0.0 or ("ti7201" in times and tn >= OFF_7201) else tn), times["td"]


def periods_of(make: Make, longest_s: float = _LONGEST_S) -> list[tuple[Number, float]]:
    """Return the numbers of a cycle time up to a longest one, and what they mean [s], rising; at least one sample."""
    entry = by_role(make, "cycle")
    if entry is None:
        return []
    last = round(min(entry.high, 10.0**entry.decimals * 999.0) * (10.0**entry.decimals if entry.real else 1.0))
    if longest_s < math.inf and not make.codes:  # numbers mean themselves
        last = min(last, math.ceil(longest_s * 10.0**entry.decimals))
    first = round(entry.low * (10.0**entry.decimals if entry.real else 1.0))
    pairs = [(_written(entry, digits / 10.0**entry.decimals), digits / 10.0**entry.decimals)
             for digits in range(first, last + 1)]
    meant = [(number, make.codes.get(int(number), value) if make.codes else value) for number, value in pairs]
    return [(number, value) for number, value in meant if make.sample_s[0] - 1e-9 <= value <= longest_s + 1e-9]


def period_of(make: Make, values: Mapping[str, Number]) -> float:
    """Return the PWM period that words hold [s]."""
    entry = by_role(make, "cycle")
    if entry is None:
        assert make.period_s is not None
        return make.period_s
    number = values[entry.name]
    if int(number) in make.codes and not entry.real:
        return make.codes[int(number)]
    return round(entry_value(entry, number), 6)


def with_period(make: Make, values: Mapping[str, Number], period_s: float) -> dict[str, Number]:
    """Return the words with another PWM period.

    Raises:
        OutOfRange: none of the instrument's cycle times.
    """
    entry = by_role(make, "cycle")
    if entry is None:
        raise OutOfRange("pwm_period_s", period_s, f"{make.period_s:g} s: this instrument has no cycle time")
    allowed = periods_of(make, math.inf)
    for number, value in allowed:
        if abs(value - period_s) <= 1e-6:
            return {**values, entry.name: number}
    nearest = min((value for _, value in allowed), key=lambda value: abs(value - period_s))
    raise OutOfRange("pwm_period_s", period_s, f"a cycle time of the instrument; the nearest is {nearest:g} s")


def block_of(make: Make, words: Words, assume: PbandAssumptions) -> PbandBlock:
    """Return the constants of the words that a sample uses."""
    values, ta = words.values, words.sample_time_s
    unit_degC = words.scaling.span_degC / COUNTS
    band = band_degC(make, values, words.scaling.span_degC) / unit_degC
    tn, tv = _times(make, values)
    lag = tv / (0.5 * LAG_PARTS if assume.slow else LAG_PARTS)
    by_role = {entry.role: entry_value(entry, values[entry.name]) for entry in make.entries}
    return PbandBlock(
        gain=100.0 / band, growth=0.0 if math.isinf(tn) else ta / tn, slope=tv / ta, share=ta / (lag + ta),
        high=by_role.get("high", 100.0), least=by_role.get("least", 0.0), band=band,
        approach=by_role["approach"] * band if "approach" in by_role else math.inf, alpha=by_role.get("alpha", _ALPHA),
        follows=0.0 if math.isinf(tn) else min(ta / (tn + ta), 1.0), tenth=0.1 / unit_degC)


def oddities(make: Make, words: Words) -> tuple[str, ...]:
    """Return warnings about an instrument's parameters, one sentence each."""
    values = words.values
    tn, _ = _times(make, values)
    notes = [f"{by.name} is 0: there is no integral part." for by in make.entries
             if by.role in ("ti", "ti7201") and math.isinf(tn)]
    for entry in make.entries:
        number = values[entry.name]
        if entry.role == "high" and entry_value(entry, number) < 100.0:
            notes.append(f"{entry.name} is {display_text(entry, values)} %: the output is limited to it.")
        if entry.role == "least" and number:
            notes.append(f"{entry.name} is {display_text(entry, values)} %: no pulse below it, no pause above 100 % "
                         f"less it.")
        if entry.role == "approach" and number != entry.fixed:
            notes.append(f"{entry.name} is {display_text(entry, values)} bands: beyond it there is no derivative part.")
        if entry.role == "cutback" and not _one_band(make, entry, words):
            notes.append(f"{entry.name} is {display_text(entry, values)} °C, not the proportional band: what it does "
                         f"then is not published, and not proven.")
    return tuple(notes)


def consistent(make: Make, words: Words) -> None:
    """Refuse words whose working nobody publishes.

    Raises:
        OutOfRange: a cutback that is not the proportional band.
    """
    for entry in make.entries:
        if entry.role == "cutback" and not _one_band(make, entry, words):
            band = band_degC(make, words.values, words.scaling.span_degC)
            raise OutOfRange(f"word {entry.name}", words.values[entry.name],
                             f"{10.0**entry.decimals * band:.0f}, the proportional band: what another one does is not "
                             "published")


def _one_band(make: Make, entry: Entry, words: Words) -> bool:
    """Return whether a cutback is the proportional band, to a digit of either."""
    band = band_degC(make, words.values, words.scaling.span_degC)
    digit = 10.0**-entry.decimals * (1.0 + words.scaling.span_degC / 100.0)
    return abs(entry_value(entry, words.values[entry.name]) - band) <= digit
