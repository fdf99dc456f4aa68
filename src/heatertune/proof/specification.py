"""The specification of a loop: limits in plant units and the test sequence; and presets for kinds of users.

Each limit of a preset has its reason and source: AMS 2750F (pyrometry: classes of furnaces), IPC/JEDEC J-STD-020
(reflow), DIN 12876 (laboratory baths), DIN 12880 (heating ovens), the defaults of Marlin's Configuration.h, and, where
no standard applies, the practice of the trade.

`spec.toml` is a specification as a file that a person reads, changes and gives back.
"""

from __future__ import annotations

import math
import re
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from functools import cache, lru_cache, partial
from pathlib import Path
from types import MappingProxyType
from typing import Final, NamedTuple, TypeVar

from heatertune.codec import LEFT_OUT, read_toml
from heatertune.errors import DocumentError, HeatertuneError, InputError, OutOfRange, UnknownName, one_line
from heatertune.proof.criteria import LIMITS, LoopLimits, limit_of
from heatertune.proof.profile import Profile, profile_of_table, read_profile, table_of
from heatertune.proof.test_sequence import TestSequence
from heatertune.settings import Conditions
from heatertune.units import check

__all__ = [
    "GENERAL", "NOTHING", "PRESETS", "STORY", "Preset", "SequencePart", "Specification", "default_limit",
    "highest_temperature", "in_force", "limits_from", "preset", "quantity", "read_spec", "relaxed_limits",
    "spec_text", "specification_of", "split",
]

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
_SETTINGS: Final = {"on": True, "off": False}


@dataclass(frozen=True, slots=True, kw_only=True)
class SequencePart:
    """What of the story can be set.

    Attributes:
        what: its meaning.
        field: of `Story`.
        unit: of its number; empty: it is there or not, "on" or "off".
        factor: by which its number is multiplied.
    """

    description: str
    field: str
    unit: str = ""
    factor: float = 1.0


#: everything of the story that a user can set, by the name that a user writes
STORY: Final[dict[str, SequencePart]] = {
    "temperature-step": SequencePart(description="the temperature falls at once, of the rise above ambient: cold "
                                                 "goods, open doors",
                 field="step_share", unit="%", factor=0.01),
    "load": SequencePart(description="a load takes this share of full power for five (T+L), and is removed",
                 field="load_pct", unit="%"),
    "open-circuit": SequencePart(description="the heater circuit is open for two TN and for a long outage, with the "
                                             "PLC running",
                                 field="opens"),
    "setpoint-change": SequencePart(description="the setpoint falls to the lower end of the setpoints of use, and "
                                                "rises again; small "
                            "changes likewise",
                            field="changes"),
    "mains": SequencePart(description="the mains voltage falls and rises by 10 %", field="mains"),
    "restart": SequencePart(description="the controller is restarted with the heater hot, and cold", field="restarts"),
    "paper-times": SequencePart(description="heat-up and temperature step alone, in the 27th minute as in the paper's "
                                            "record, "
                        "slower heaters in proportion", field="paper_times"),
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Specification:
    """What a loop must keep, in the user's words.

    Attributes:
        name: of the preset it began from, or of the file.
        limits: name → values as written, all of which hold; no value: nothing is asked for.
        story: part → how it is, as written; what is not named is as `Story` has it.
        reasons: name → why, where it is told.
        changed: names of the limits that options set beside preset and file.
        profile: along which the setpoint is led; None: along none.
        base: of a file, the preset it began from; None: the general one, or the preset that `name` says.

    Raises:
        UnknownName: no such limit.
        InputError: no number, no unit of it, or nothing where a limit there must be.
        OutOfRange: a negative number, or one that is not finite.
    """

    name: str
    limits: Mapping[str, tuple[str, ...]]
    story: Mapping[str, str] = field(default_factory=dict)
    reasons: Mapping[str, str] = field(default_factory=dict)
    changed: tuple[str, ...] = ()
    profile: Profile | None = field(default=None, metadata=LEFT_OUT)
    base: str | None = field(default=None, metadata=LEFT_OUT)

    def __post_init__(self) -> None:
        for name, values in self.limits.items():
            kind = limit_of(name)
            if kind.is_required and not values:
                raise InputError(f"limit {name} is {NOTHING!r}; expected a value, such as {kind.example!r}")
            for value in values:
                quantity(name, value)
        self.story_at(None)

    @property
    def tolerance_degC(self) -> float:
        """How far from the setpoint is still right [°C]."""
        return self.limits_for(1.0).tolerance_degC

    def limits_for(self, heater_s: float) -> LoopLimits:
        """Return what a loop must keep.

        Args:
            heater_s: lags and dead time of the slowest plausible heater [s].
        """
        by_field: dict[str, float | None] = {
            measure.field: None for kind in LIMITS.values() for measure in kind.units.values() if not kind.is_required}
        for name, values in self.limits.items():
            for value in values:
                number, unit = quantity(name, value)
                measure = LIMITS[name].units[unit]
                limit = number * (heater_s if unit == "T+L" else measure.factor)
                before = by_field.get(measure.field)
                tighter = max if LIMITS[name].at_least else min
                by_field[measure.field] = limit if before is None else tighter(before, limit)
        return LoopLimits(**by_field)  # type: ignore[arg-type]  # the fields are named in LIMITS

    def story_at(self, setpoint_low_degC: float | None) -> TestSequence:
        """Return what words have to live through.

        Args:
            setpoint_low_degC: lower end of the setpoints of use; None: nobody told it [°C].
        """
        settings = {_part(name).field: _setting(name, value) for name, value in self.story.items()}
        return TestSequence(setpoint_low_degC=setpoint_low_degC, profile=self.profile, **settings)  # type: ignore[arg-type]  # named in STORY

    def with_limits(self, limits: Mapping[str, tuple[str, ...]]) -> Specification:
        """Return it with some limits as given instead; errors as on construction."""
        return Specification(
            name=self.name, limits={**self.limits, **limits}, story=self.story, profile=self.profile, base=self.base,
            changed=tuple(dict.fromkeys((*self.changed, *limits))),
            reasons={name: why for name, why in self.reasons.items() if name not in limits})


def limits_from(texts: Iterable[str]) -> dict[str, tuple[str, ...]]:
    """Return limits written as NAME=VALUE; values of one name hold together, "none" asks for nothing.

    Raises:
        InputError: no "=", or nothing together with a value.
        UnknownName: no such limit.
    """
    by_name: dict[str, list[str]] = {}
    for text in texts:
        name, equals, value = (part.strip() for part in text.partition("="))
        if not equals:
            raise InputError(f"--limit {text!r} has no value; expected NAME=VALUE, such as overshoot=5%")
        limit_of(name)
        by_name.setdefault(name, []).append(value)
    return {name: split(name, values) for name, values in by_name.items()}


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


def _part(name: str) -> SequencePart:
    if name not in STORY:
        raise UnknownName("part of the test sequence", name, STORY)
    return STORY[name]


def _setting(name: str, text: str) -> float | bool:
    """Return a setting of the story: whether a part is there, or how hard it is."""
    part = STORY[name]
    if not part.unit:
        if text not in _SETTINGS:
            raise InputError(f"story {name} is {text!r}; expected {' or '.join(_SETTINGS)}")
        return _SETTINGS[text]
    if text == "off":
        return 0.0
    spelled = _NUMBER.match(text)
    if spelled is None or spelled[2] != part.unit:
        raise InputError(f"story {name} is {text!r}; expected a number with its unit {part.unit}, or off")
    return float(spelled[1]) * part.factor


@lru_cache(maxsize=256)
def quantity(name: str, text: str) -> tuple[float, str]:
    """Return number and unit of a value of a limit.

    Raises:
        UnknownName: no such limit.
        InputError: no number, or a unit that this limit does not have.
        OutOfRange: a number that the limit cannot have.
    """
    units = limit_of(name).units
    spelled = _NUMBER.match(text)
    expected = f"a number with its unit ({' or '.join(units)})" if any(units) else "a number without a unit"
    if spelled is None:
        raise InputError(f"limit {name} is {text!r}; expected {expected}, such as {LIMITS[name].example!r}")
    unit = _SPELLINGS.get(spelled[2], spelled[2])
    if unit not in units:
        unit_text = f"the unit {spelled[2]!r}" if spelled[2] else "no unit"
        raise InputError(f"limit {name} is {text!r}, with {unit_text}; expected {expected}")
    number = float(spelled[1])
    try:
        check(name, number, least=LIMITS[name].least)
    except OutOfRange as problem:
        raise OutOfRange(f"limit {name}", number, problem.rule) from None
    return number, unit


_ROUNDING: Final = 1e-9  # of a limit


class Preset(NamedTuple):
    """What a kind of user asks for beyond the general: whose it is, limits with their reasons, parts of the story."""

    description: str
    limits: Mapping[str, tuple[str, str]]
    story: Mapping[str, str] = MappingProxyType({})


PRESETS: Final[dict[str, Preset]] = {
    GENERAL: Preset("any heater", {}),
    "paper": Preset("the record of the paper: heat-up, and a fall in the 27th minute", {}, {"paper-times": "on"}),
    "teaching": Preset("a first course in control", {
        "overshoot": ("25 %", "a quarter decay, as the first tuning rules aimed at, still passes"),
        "recovery-overshoot": ("25 %", "likewise"),
        "reheat-overshoot": ("50 %", "likewise, twice"),
    }),
    "furnace": Preset("heat treatment: no overshoot, slow ramps", {
        "tolerance": ("1.5 degC", "a quarter of the ±6 °C of class 2, AMS 2750F: the rest is the furnace's uniformity"),
        "overshoot": ("1.5 degC", "no sensor above the class's limit at any time, AMS 2750F"),
        "recovery-overshoot": ("3 degC", "half of the class"),
        "reheat-overshoot": ("6 degC", "the class itself"),
    }),
    "kiln": Preset("ceramics and glass", {
        "tolerance": ("3 degC", "hold within 2 to 3 °C: practice"),
        "overshoot": ("5 degC", "3 to 5 °C: practice; cones answer to the peak"),
        "reheat-overshoot": ("10 degC", "twice that of the heat-up"),
    }),
    "extruder": Preset("extruder and injection barrels", {
        "tolerance": ("1 degC", "±1 °C, ±0.5 °C is good: practice"),
        "overshoot": ("5 degC", "3 to 5 °C, or the melt is damaged: practice"),
        "recovery-overshoot": ("3 degC", "practice"),
        "reheat-overshoot": ("10 degC", "twice that of the heat-up"),
    }),
    "hot-end": Preset("3D printer's nozzle", {
        "tolerance": ("1 degC", "TEMP_WINDOW of Marlin's Configuration.h"),
        "overshoot": ("10 degC", "MAXTEMP stands 15 °C above the hottest setpoint (HOTEND_OVERSHOOT, Marlin): a third "
                      "is kept"),
        "recovery-overshoot": ("5 degC", "practice"),
        "reheat-overshoot": ("15 degC", "HOTEND_OVERSHOOT, Marlin"),
    }),
    "reflow": Preset("reflow soldering", {
        "tolerance": ("5 degC", "time within 5 °C of the peak counts, J-STD-020"),
        "overshoot": ("5 degC", "the peak may not be exceeded by more than its own window, J-STD-020"),
        "reheat-overshoot": ("10 degC", "twice that of the heat-up"),
        "settling": ("8 min", "25 °C to peak in 8 min at most, J-STD-020 (lead-free)"),
    }),
    "bath": Preset("laboratory bath", {
        "tolerance": ("0.1 degC", "half of the difference of largest and smallest reading over 30 min, DIN 12876"),
        "overshoot": ("0.5 degC", "practice"),
        "recovery-overshoot": ("0.5 degC", "practice"),
        "reheat-overshoot": ("2 degC", "practice"),
    }),
    "oven": Preset("drying or heating oven", {
        "tolerance": ("1 degC", "±1 to ±2 °C in time, DIN 12880"),
        "overshoot": ("2 degC", "practice: goods must not get hotter than the setpoint"),
        "recovery-overshoot": ("2 degC", "likewise"),
        "reheat-overshoot": ("4 degC", "twice that of the heat-up"),
    }),
}

#: overshoot after a small change of the setpoint, of that change [%]
SMALL_CHANGE_PCT: Final = 65.0

#: why the general limits are as they are
_REASONS: Final = {
    "tolerance": "acceptable for most heaters",
    "overshoot": "this project's choice for heaters; use less where the goods require it",
    "recovery-overshoot": "as on heat-up",
    "reheat-overshoot": "twice that of the heat-up: a fault, not use; a controller that winds up without end breaks it",
    "small-change-overshoot": "what a PI at the limit Ms 2 does on a slow heater with a short dead time, 55 to 60 %; "
                              "a quarter to a half at Ms 1.6",
    "ms": "K. J. Åström, T. Hägglund, Advanced PID Control, ISA 2006",
    "gain-margin": "D. E. Seborg, T. F. Edgar, D. A. Mellichamp, Process Dynamics and Control: 1.7 to 4",
    "phase-margin": "Seborg, Edgar, Mellichamp: 30 to 45°",
    "step-power": "a reading that flickers by one step must not make the heater flicker",
}


def preset(name: str) -> Specification:
    """Return a specification to begin from.

    Raises:
        UnknownName: there is none of that name.
    """
    if name not in PRESETS:
        raise UnknownName("specification", name, PRESETS)
    own = PRESETS[name].limits
    return Specification(
        name=name, story=dict(PRESETS[name].story),
        limits={**_general(), **{limit: (value,) for limit, (value, _) in own.items()}},
        reasons={**_REASONS, **{limit: why for limit, (_, why) in own.items()}})


def relaxed_limits(spec: Specification, rise_degC: float) -> tuple[str, ...]:
    """Return what a specification asks less of than its preset does, such as "overshoot 30 % (default 20 %)".

    Limits in other units than the preset's are compared by the rise; parts of the test sequence count as well.

    Args:
        spec: in force; of a file its preset is `base`.
        rise_degC: from ambient to the setpoint [°C].
    """
    usual = preset(spec.base or (spec.name if spec.name in PRESETS else GENERAL))
    limits = [_limit_text(name, own, values) for name, values in usual.limits.items()
              if any(_asks_less(name, own := spec.limits.get(name, ()), value, rise_degC) for value in values)]
    mild, hard = spec.story_at(None), usual.story_at(None)
    parts = [f"{name} {_part_told(part, mild)} (default {_part_told(part, hard)})" for name, part in STORY.items()
             if _is_milder(getattr(mild, part.field), getattr(hard, part.field), inverted=name == "paper-times")]
    return (*limits, *parts)


def default_limit(spec: Specification, name: str, unit: str) -> float | None:
    """Return what the preset of a specification asks for in a unit; None: nothing."""
    usual = preset(spec.base or (spec.name if spec.name in PRESETS else GENERAL))
    return next((number for number, its in (quantity(name, value) for value in usual.limits.get(name, ()))
                 if its == unit), None)


def _asks_less(name: str, own: Sequence[str], usual: str, rise_degC: float) -> bool:
    """Return whether the values of a limit, all of which hold, allow more than the usual one."""
    number, unit = quantity(name, usual)
    sign = -1.0 if LIMITS[name].at_least else 1.0
    values = [_in_unit(name, value, its, unit, rise_degC) for value, its in (quantity(name, each) for each in own)]
    limits = [sign * value for value in values if value is not None]
    return not limits or min(limits) > sign * number + _ROUNDING * abs(number)


def _in_unit(name: str, value: float, unit: str, wanted: str, rise_degC: float) -> float | None:
    """Return a value of a limit in another unit; None: it has no meaning there."""
    units = LIMITS[name].units
    if unit == wanted:
        return value
    if units[unit].field == units[wanted].field and "T+L" not in (unit, wanted):
        return value * units[unit].factor / units[wanted].factor
    if {unit, wanted} == {"%", "degC"} and rise_degC > 0.0:
        return 100.0 * value / rise_degC if wanted == "%" else value * rise_degC / 100.0
    return None


def _is_milder(own: float | bool, usual: float | bool, *, inverted: bool) -> bool:
    return own > usual if inverted else own < usual


def _limit_text(name: str, own: Sequence[str], usual: Sequence[str]) -> str:
    def text(values: Sequence[str]) -> str:
        pairs = (quantity(name, value) for value in values)
        return " and ".join(f"{number:.6g} {unit}".strip() for number, unit in pairs).replace("degC", "°C") or NOTHING

    return f"{name.replace('-', ' ')} {text(own)} (default {text(usual)})"


def _part_told(part: SequencePart, story: TestSequence) -> str:
    value = getattr(story, part.field)
    return ("on" if value else "off") if not part.unit else f"{value / part.factor:g} {part.unit}"


def _general() -> dict[str, tuple[str, ...]]:
    """Return the defaults of `Limits` as a user would write them."""
    defaults = {one.name: one.default for one in fields(LoopLimits)}
    limits: dict[str, tuple[str, ...]] = {}
    defaults["small_change_overshoot_pct"] = SMALL_CHANGE_PCT
    for name, kind in LIMITS.items():
        measures = {measure.field: unit for unit, measure in kind.units.items() if measure.factor == 1.0}
        limits[name] = tuple(f"{defaults[field]:g} {unit}".strip() for field, unit in measures.items()
                             if unit != "T+L" and defaults[field] is not None)
    return limits


_T = TypeVar("_T")

_TABLES: Final = ("preset", "limits", "story", "profile")


def specification_of(conditions: Conditions) -> Specification:
    """Return the specification in force: options in place of what the preset or file says.

    Raises:
        InputError, UnknownName: as `in_force`.
    """
    own = {"tolerance": conditions.tolerance_degC, "step-power": conditions.step_power_pct}
    units = {"tolerance": "degC", "step-power": "%"}
    flags = [f"{name}={NOTHING if math.isinf(value) else f'{float(value)!r} {units[name]}'}"
             for name, value in own.items() if value is not None]
    return in_force(conditions.spec, [*flags, *conditions.limit], conditions.profile)


def highest_temperature(conditions: Conditions) -> float | None:
    """Return the highest temperature that specification and interlock allow [°C]; None: neither names one.

    Raises:
        InputError, UnknownName: as `in_force`.
    """
    limits = (specification_of(conditions).limits_for(1.0).peak_degC, conditions.limit_degC)
    return min((limit for limit in limits if limit is not None), default=None)


def in_force(spec: str | None = None, limits: Sequence[str] = (), profile: str | None = None) -> Specification:
    """Return the specification that holds.

    Args:
        spec: name of a preset, or path of a file (it ends in .toml); None: the general one.
        limits: NAME=VALUE, each in place of the specification's own of that name.
        profile: path of a profile's file; None: the specification's own, if it has one.

    Raises:
        UnknownName: no such preset or limit.
        DocumentError: a file that cannot be read as a specification or profile; it names the file and the place in it.
        InputError, OutOfRange: as `limits_from` and `Specification`.
    """
    limits = tuple(limits)
    base = _of_preset(spec or GENERAL, limits) if spec is None or spec in PRESETS else _limited(_of_file(spec), limits)
    return base if profile is None else replace(base, profile=read_profile(profile))


@cache
def _of_preset(name: str, limits: tuple[str, ...]) -> Specification:
    return _limited(preset(name), limits)


def _limited(begun: Specification, limits: Sequence[str]) -> Specification:
    return begun.with_limits(limits_from(limits)) if limits else begun


def _of_file(spec: str) -> Specification:
    if not spec.endswith(".toml"):
        raise UnknownName("specification", spec, [*PRESETS, "a file FILE.toml"])
    return read_spec(spec)


def read_spec(path: str | Path) -> Specification:
    """Return the specification of a file: its preset's limits, those that it names being its own.

    Raises:
        DocumentError: it cannot be read, is no TOML, or a table, key or value is not one of a specification.
    """
    document = read_toml(path)
    for name in document:
        if name not in _TABLES:
            raise DocumentError(f"{path}: {name}: no such table; expected {' or '.join(_TABLES)}")
    base, limits, story = document.get("preset", GENERAL), document.get("limits", {}), document.get("story", {})
    for name, value, kind in (("preset", base, str), ("limits", limits, dict), ("story", story, dict)):
        if not isinstance(value, kind):
            raise DocumentError(f"{path}: {name}: expected a {'text' if kind is str else 'table'}")
    start = _at(f"{path}: preset", partial(preset, base))
    changes = {name: _at(f"{path}: limits.{name}", partial(_own_limit, start, name, value))
               for name, value in limits.items()}
    parts = {name: _at(f"{path}: story.{name}", partial(_own_part, start, name, value))
             for name, value in story.items()}
    return Specification(
        name=Path(path).name, limits={**start.limits, **changes}, story={**start.story, **parts},
        profile=_profile(Path(path), document.get("profile")), base=None if base == GENERAL else base,
        reasons={name: why for name, why in start.reasons.items() if changes.get(name) in (None, start.limits[name])})


def _at(place: str, read: Callable[[], _T]) -> _T:
    """Return what is read at a place of a file; an error names it."""
    try:
        return read()
    except HeatertuneError as problem:
        raise DocumentError(f"{place}: {problem}") from problem


def _own_limit(begun: Specification, name: str, value: object) -> tuple[str, ...]:
    values = split(name, _texts(value))
    begun.with_limits({name: values})
    return values


def _own_part(begun: Specification, name: str, value: object) -> str:
    setting = _setting_text(value)
    replace(begun, story={name: setting})
    return setting


def _profile(path: Path, value: object) -> Profile | None:
    """Return the profile of a file beside the specification, or of its own table."""
    if isinstance(value, str):
        return read_profile(path.parent / value)
    if isinstance(value, dict):
        return profile_of_table(path.name, value, f"{path}: profile")
    if value is not None:
        raise DocumentError(f"{path}: profile: expected the name of a file, or a table of lists")
    return None


def _texts(value: object) -> list[str]:
    if isinstance(value, str):
        return [value]
    if isinstance(value, list) and value and all(isinstance(item, str) for item in value):
        return value
    if isinstance(value, int | float) and not isinstance(value, bool):
        return [repr(value)]
    raise DocumentError(f"expected a text such as {'5 %'!r}, or a list of such texts")


def _setting_text(value: object) -> str:
    if isinstance(value, bool):
        return "on" if value else "off"
    if isinstance(value, str):
        return value
    raise DocumentError("expected true, false or a text such as '10 %'")


def spec_text(spec: Specification) -> str:
    """Return a specification as the text of a file that says the same, with its reasons."""
    return "\n".join([*_lines(spec), ""])


def _lines(spec: Specification) -> Iterator[str]:
    origin = spec.name if spec.name in PRESETS else GENERAL
    yield f"# What words must keep before they leave: the specification {one_line(spec.name)}"
    yield "# Change what you need, then: heatertune design LOG --target NAME --spec FILE.toml"
    yield f"# Several values of one name hold together: [\"5 %\", \"3 degC\"]; \"{NOTHING}\" asks for nothing."
    yield f'preset = "{origin}"  # {PRESETS[origin].description}; what stands below is in its place'
    yield ""
    yield "[limits]"
    for name, kind in LIMITS.items():
        values = spec.limits.get(name, ())
        units = " or ".join(unit for unit in kind.units if unit)
        yield f"# {kind.description}{f' ({units})' if units else ''}"
        if values:
            why = spec.reasons.get(name, "")
            yield f"{name} = {_value(values)}" + (f"  # {why}" if why else "")
        else:
            dropped = bool(preset(origin).limits.get(name))
            yield f'{name} = "{NOTHING}"' if dropped else f'# {name} = "{kind.example}"'


    yield ""
    yield "[story]"
    for name, part in STORY.items():
        yield f"# {part.description}"
        yield f"{name} = {_part_text(spec.story_at(None), part)}"
    if spec.profile is not None:
        yield ""
        yield f"[profile]  # {one_line(spec.profile.name)}"
        yield from (f'"{head}" = {cells}' for head, cells in table_of(spec.profile).items())


def _part_text(story: TestSequence, part: SequencePart) -> str:
    """Return how a part of the story is, as TOML says it."""
    value = getattr(story, part.field)
    return str(value).lower() if isinstance(value, bool) else f'"{value / part.factor:g} {part.unit}"'


def _value(values: Sequence[str]) -> str:
    texts = [f'"{value}"' for value in values]
    return texts[0] if len(texts) == 1 else f"[{', '.join(texts)}]"
