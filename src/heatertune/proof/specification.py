"""What a user specifies: limits in the units of the plant, several of one name at once, and where they come from."""

from __future__ import annotations

import re
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from heatertune.errors import InputError, OutOfRange, UnknownName
from heatertune.proof.criteria import Limits
from heatertune.units import check

__all__ = ["GENERAL", "LIMITS", "NOTHING", "Limit", "Measure", "Specification", "limit_of", "limits_from", "split"]

#: what holds where nothing is said
GENERAL: Final = "general"
#: says that nothing is asked for
NOTHING: Final = "none"

_NUMBER: Final = re.compile(r"\s*([+-]?(?:\d+\.?\d*|\.\d+)(?:[eE][+-]?\d+)?)\s*(.*?)\s*\Z", re.DOTALL)
#: other spellings of a unit
_SPELLINGS: Final = {
    "°C": "degC", "K": "degC", "C": "degC", "°": "deg", "sec": "s", "seconds": "s", "minutes": "min", "hours": "h",
    "1/h": "/h", "per hour": "/h", "percent": "%", "degC s": "degC·s", "degC*s": "degC·s", "(T+L)": "T+L",
}
_TIMES: Final = {"s": 1.0, "min": 60.0, "h": 3600.0}


class Measure(NamedTuple):
    """A unit of a limit: the field of `Limits` it sets, and by what a number in it is multiplied."""

    field: str
    factor: float = 1.0


@dataclass(frozen=True, slots=True, kw_only=True)
class Limit:
    """What can be limited.

    Attributes:
        what: its meaning.
        units: unit → what it sets; "T+L" counts in the slowest possible heater's lags and dead time.
        example: a value, as a user would write it.
        at_least: whether the value must be reached; otherwise it must not be exceeded.
        demanded: whether a limit there must be: nothing cannot be asked for.
    """

    what: str
    units: Mapping[str, Measure]
    example: str
    at_least: bool = False
    demanded: bool = False


def _of_time(field_: str) -> dict[str, Measure]:
    return {unit: Measure(field_, factor) for unit, factor in _TIMES.items()} | {"T+L": Measure(field_)}


#: everything that a user can limit, by the name that a user writes
LIMITS: Final[dict[str, Limit]] = {
    "tolerance": Limit(
        what="how far from the setpoint is still right: half width of the band, limit of offset and swing at rest",
        units={"degC": Measure("tolerance_degC")}, example="1 degC", demanded=True),
    "overshoot": Limit(
        what="beyond the setpoint on heat-up, of the setpoint step",
        units={"%": Measure("overshoot_pct"), "degC": Measure("overshoot_degC")}, example="5 %"),
    "settling": Limit(
        what="time from cold until the temperature stays in the band", units=_of_time("settling_s"), example="20 min"),
    "recovery": Limit(
        what="time after a disturbance until the temperature stays in the band", units=_of_time("recovery_s"),
        example="5 min"),
    "recovery-overshoot": Limit(
        what="beyond the setpoint after a disturbance, on the other side, of the setpoint step",
        units={"%": Measure("recovery_overshoot_pct"), "degC": Measure("recovery_overshoot_degC")}, example="5 %"),
    "load-deviation": Limit(
        what="largest distance from the setpoint after a disturbance, on its side",
        units={"degC": Measure("deviation_degC")}, example="2 degC"),
    "ripple": Limit(
        what="peak to peak within one PWM period at rest", units={"degC": Measure("pwm_ripple_degC")},
        example="0.2 degC"),
    "iae": Limit(
        what="integral of the absolute error over the whole story", units={"degC·s": Measure("iae_degC_s")},
        example="5000 degC·s"),
    "saturation": Limit(
        what="share of the scans that ask for 0 or 100 % power", units={"%": Measure("saturation_pct")},
        example="50 %"),
    "switchings": Limit(
        what="how often the heater is switched on", units={"/h": Measure("switchings_per_h")}, example="30 /h"),
    "ms": Limit(what="maximum sensitivity Ms", units={"": Measure("ms")}, example="1.7"),
    "gain-margin": Limit(
        what="factor by which the heater's gain may grow", units={"": Measure("gain_margin")}, example="2.5",
        at_least=True),
    "phase-margin": Limit(
        what="phase that the loop may lose", units={"deg": Measure("phase_margin_deg")}, example="45 deg",
        at_least=True),
    "step-power": Limit(
        what="power that one step of the reading, or its noise, may move", units={"%": Measure("step_power_pct")},
        example="10 %"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Specification:
    """What a loop must keep, in the user's words.

    Attributes:
        name: of the preset it began from, or of the file.
        limits: name → values as written, all of which hold; no value: nothing is asked for.
        reasons: name → why, where it is told.
        changed: names of the limits that options set beside preset and file.

    Raises:
        UnknownName: no such limit.
        InputError: no number, no unit of it, or nothing where a limit there must be.
        OutOfRange: a negative number, or one that is not finite.
    """

    name: str
    limits: Mapping[str, tuple[str, ...]]
    reasons: Mapping[str, str] = field(default_factory=dict)
    changed: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        for name, values in self.limits.items():
            kind = limit_of(name)
            if kind.demanded and not values:
                raise InputError(f"limit {name} is {NOTHING!r}; expected a value, such as {kind.example!r}")
            for value in values:
                _quantity(name, value)

    @property
    def tolerance_degC(self) -> float:
        """How far from the setpoint is still right [°C]."""
        return self.limits_for(1.0).tolerance_degC

    def limits_for(self, heater_s: float) -> Limits:
        """Return what a loop must keep.

        Args:
            heater_s: lags and dead time of the slowest possible heater [s].
        """
        given: dict[str, float | None] = {
            measure.field: None for kind in LIMITS.values() for measure in kind.units.values() if not kind.demanded}
        for name, values in self.limits.items():
            for value in values:
                number, unit = _quantity(name, value)
                measure = LIMITS[name].units[unit]
                wanted = number * (heater_s if unit == "T+L" else measure.factor)
                before = given.get(measure.field)
                tighter = max if LIMITS[name].at_least else min
                given[measure.field] = wanted if before is None else tighter(before, wanted)
        return Limits(**given)  # type: ignore[arg-type]  # the fields are named in LIMITS

    def with_limits(self, given: Mapping[str, tuple[str, ...]]) -> Specification:
        """Return it with some limits as given instead; errors as on construction."""
        return Specification(
            name=self.name, limits={**self.limits, **given}, changed=tuple(dict.fromkeys((*self.changed, *given))),
            reasons={name: why for name, why in self.reasons.items() if name not in given})


def limit_of(name: str) -> Limit:
    """Return what a name limits; raise UnknownName where it is none."""
    if name not in LIMITS:
        raise UnknownName("limit", name, LIMITS)
    return LIMITS[name]


def limits_from(texts: Iterable[str]) -> dict[str, tuple[str, ...]]:
    """Return limits written as NAME=VALUE; values of one name hold together, "none" asks for nothing.

    Raises:
        InputError: no "=", or nothing together with a value.
        UnknownName: no such limit.
    """
    given: dict[str, list[str]] = {}
    for text in texts:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not equals:
            raise InputError(f"--limit {text!r} has no value; expected NAME=VALUE, such as overshoot=5%")
        limit_of(name)
        given.setdefault(name, []).append(value)
    return {name: split(name, values) for name, values in given.items()}


def split(name: str, values: Sequence[str]) -> tuple[str, ...]:
    """Return the values of a limit, those in one text apart; ("none",) is none.

    Raises:
        InputError: nothing together with a value.
    """
    parts = tuple(part.strip() for value in values for part in " ".join(value.split()).split(" and "))
    if NOTHING not in parts:
        return parts
    if len(parts) > 1:
        raise InputError(f"limit {name} is {' and '.join(parts)!r}; {NOTHING} stands alone")
    return ()


def _quantity(name: str, text: str) -> tuple[float, str]:
    """Return number and unit of a value."""
    units = limit_of(name).units
    spelled = _NUMBER.match(text)
    expected = f"a number with its unit ({' or '.join(units)})" if any(units) else "a number without a unit"
    if spelled is None:
        raise InputError(f"limit {name} is {text!r}; expected {expected}, such as {LIMITS[name].example!r}")
    unit = _SPELLINGS.get(spelled[2], spelled[2])
    if unit not in units:
        given = f"the unit {spelled[2]!r}" if spelled[2] else "no unit"
        raise InputError(f"limit {name} is {text!r}, with {given}; expected {expected}")
    number = float(spelled[1])
    try:
        check(name, number, least=0.0)
    except OutOfRange as problem:
        raise OutOfRange(f"limit {name}", number, problem.rule) from None
    return number, unit
