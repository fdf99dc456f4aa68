"""What a controller holds: number formats, words and their fields, the scaling of the sensor, and the certificate.

A design fits a controller if its timer can keep the sampling interval and every word takes its value. `Cycle` says
which words hold the PWM period, for a controller that makes its own pulses.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Final, NamedTuple, TypedDict, cast

from heatertune.codec import LEFT_OUT
from heatertune.errors import InputError, NotRepresentable, OutOfRange
from heatertune.pid.design_values import Timer
from heatertune.plc.pwm import Actuator
from heatertune.plc.ramp import Boost, Number, Ramp
from heatertune.plc.single_precision import is_single, single
from heatertune.show import NotebookDisplay, runner
from heatertune.units import check

if TYPE_CHECKING:
    from heatertune.plc.core import RunningController

__all__ = [
    "FLOATS", "FORMATS", "Certificate", "Cycle", "EntryChange", "Scaling", "WordField", "Words", "check_fields",
    "check_limits", "holds", "no_pid", "round_half_away", "round_to_word", "timer_interval_s", "with_pwm_period",
]

#: format of a number in a controller → smallest and largest value; what is not one of `FLOATS` is whole
FORMATS: Final[Mapping[str, tuple[float, float]]] = {
    "BOOL": (0, 1),
    "BYTE": (0, 255),
    "INT": (-32768, 32767),
    "WORD": (0, 65535),
    "UINT": (0, 65535),
    "KF": (-32768, 32767),
    "KM": (0, 65535),
    "TIME": (-2147483648, 2147483647),
    "REAL": (-3.4028234663852886e38, 3.4028234663852886e38),
    "LREAL": (-1.7976931348623157e308, 1.7976931348623157e308),
}

#: formats with a fraction → what a number in them is, as told to people
FLOATS: Final[Mapping[str, str]] = {"REAL": "a number in single precision", "LREAL": "a number in double precision"}


#: of a sensor range [°C]: below, a reading is noise alone; no furnace is hotter than the upper one
_LEAST_SPAN_DEGC: Final = 1e-3
_MOST_SPAN_DEGC: Final = 1e5


@dataclass(frozen=True, slots=True, kw_only=True)
class Scaling:
    """How the temperature becomes the controller's number: a linear sensor range.

    Attributes:
        low_degC, high_degC: the temperatures at the lowest and highest reading [°C].
        input: range of the analog module, one of `heatertune.plc.inputs.INPUTS`; None: a plain one.
        from_degC: where the module gives more than the sensor does, the sensor's own lower end [°C]; None: `low_degC`.

    Raises:
        OutOfRange: a range that is empty or upside down.
    """

    low_degC: float = 0.0
    high_degC: float = 100.0
    input: str | None = field(default=None, metadata=LEFT_OUT)
    from_degC: float | None = field(default=None, metadata=LEFT_OUT)

    def __post_init__(self) -> None:
        check("low_degC", self.low_degC, least=-273.15)
        check("high_degC", self.high_degC)
        if not self.high_degC > self.low_degC:
            raise OutOfRange("high_degC", self.high_degC, f"> low_degC = {self.low_degC:g}")
        check("high_degC - low_degC", self.span_degC, least=_LEAST_SPAN_DEGC, most=_MOST_SPAN_DEGC)

    @property
    def span_degC(self) -> float:
        """Width of the range [°C]."""
        return self.high_degC - self.low_degC

    @property
    def formula(self) -> str:
        """Temperature above the low end, for a formula that people reckon with: "°C - 20"."""
        return f"°C {'-' if self.low_degC >= 0.0 else '+'} {abs(self.low_degC):g}"

    @property
    def sensor_degC(self) -> tuple[float, float]:
        """Both ends of the sensor's own range [°C]."""
        return self.low_degC if self.from_degC is None else self.from_degC, self.high_degC


@dataclass(frozen=True, slots=True, kw_only=True)
class WordField:
    """One word of a controller: its place, format (see `FORMATS`), range and meaning.

    Attributes:
        places: decimals that the machine keeps of a number in double precision; None: all of it.
    """

    name: str
    address: str
    format: str
    low: float
    high: float
    comment: str
    places: int | None = None

    @property
    def kind(self) -> str:
        """What a number in it is, as told to people."""
        return FLOATS.get(self.format, "a whole number") if self.places is None else (
            f"a number with {self.places} decimals")

    @property
    def rule(self) -> str:
        """What a value must be, as told to people."""
        return f"{self.kind} {self.low:.9g}…{self.high:.9g}"

    def cut(self, value: float) -> float:
        """Return the largest number of its decimals that is no more than a positive one."""
        return value if self.places is None else (math.floor(round(value * 10.0**self.places, 6)) / 10.0**self.places)

    def takes(self, value: object) -> bool:
        """Return whether the word can have a value: in its format, its range and its decimals."""
        if not holds(self.format, value):
            return False
        number = cast("Number", value)
        return self.low <= number <= self.high and (self.places is None or round(number, self.places) == number)


@dataclass(frozen=True, slots=True, kw_only=True)
class Words(NotebookDisplay):
    """The numbers the PLC will hold, for one target.

    Attributes:
        target: the controller's name.
        values: word name → number as stored, REALs in single precision.
        scaling: the sensor range the words were made for.
        sample_time_s: interval at which the controller is called [s].
        ramp: how the program around the controller moves its setpoint; None: at once.
        boost: where that program gives full power itself; None: nowhere.

    Raises:
        InputError: a ramp and a boost: on a ramp the reading is never far from the setpoint.
    """

    target: str
    values: Mapping[str, Number]
    scaling: Scaling
    sample_time_s: float
    ramp: Ramp | None = None
    boost: Boost | None = None

    def __post_init__(self) -> None:
        if self.ramp is not None and self.boost is not None:
            raise InputError("a setpoint ramp and a boost: words have one of them")

    @property
    def whole(self) -> Mapping[str, int]:
        """The values, for a controller that holds whole numbers only."""
        return cast("Mapping[str, int]", self.values)

    def with_boost(self, boost: Boost | None) -> Words:
        """Return these words with a boost in place of their own and of their ramp; None: without a boost."""
        return replace(self, boost=boost, ramp=self.ramp if boost is None else None)

    def controller(self, **switches: str) -> RunningController:
        """Return the controller that runs these words, in the cold state, to be called scan by scan.

        Args:
            switches: switch=setting of what the manual leaves open; those not named have their default.

        Raises:
            OutOfRange: a word that the controller does not allow.
            UnknownName: no such target, switch or setting.
        """
        return cast("RunningController", runner()(self, switches))


@dataclass(frozen=True, slots=True, kw_only=True)
class Certificate:
    """What an export says about its proof.

    Attributes:
        verdict: "PASS", "FAIL" or "NOT PROVEN".
        lines: one line per fact (models proven on, worst criterion, …); no date, no locale.
        forced: whether the words left although the verdict is not PASS.
        setpoint_degC: what was proven [°C]; None: stated nowhere.
        actuator: the switch that was proven; the controller's own included; None: stated nowhere.
        specification: name of what was kept; None: stated nowhere.
        digest: of the proof's document; None: stated nowhere.
        switches: switch → setting that the user knows of the controller, or has chosen.
        relaxed: which limits it kept are wider than their defaults, beginning "against relaxed limits"; "": none.
    """

    verdict: str
    lines: tuple[str, ...] = ()
    forced: bool = False
    setpoint_degC: float | None = None
    actuator: Actuator | None = None
    specification: str | None = None
    digest: str | None = None
    switches: Mapping[str, str] = field(default_factory=dict)
    relaxed: str = ""

    @property
    def head(self) -> tuple[str, ...]:
        """The verdict, the facts, and under which conditions it holds, a line each, for the head of an exported file.

        Sensor range and interval are not among them: the words tell these.
        """
        forced = " - FORCED in spite of it" if self.forced else ""
        conditions = [
            None if self.setpoint_degC is None else f"proven setpoint: {self.setpoint_degC:g} °C",
            None if self.actuator is None else f"proven switch: {self.actuator.summary}",
            None if self.specification is None else f"specification: {self.specification}",
            None if self.digest is None else f"digest of the proof: {self.digest}",
        ]
        verdict = f"{self.verdict} {self.relaxed}" if self.relaxed else self.verdict
        lines = (f"verdict of the proof: {verdict}{forced}", *self.lines, *(text for text in conditions if text))
        return tuple(" ".join(line.split()) for line in lines)  # names are the user's: a line must not become two


def holds(format_: str, value: object) -> bool:
    """Return whether a number can be stored in a format: whole, or in its precision, and in its range."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    low, high = FORMATS[format_]
    fits = is_single(value) if format_ == "REAL" else isinstance(value, int) or format_ in FLOATS
    return low <= value <= high and fits


def check_fields(fields: tuple[WordField, ...], words: Words) -> None:
    """Refuse words that are not those of the fields.

    Raises:
        OutOfRange: the first word that is missing, unknown, of the wrong kind or outside its field's range.
    """
    names = [field.name for field in fields]
    unknown = sorted(set(words.values) - set(names))
    if unknown:
        raise OutOfRange(f"word {unknown[0]}", words.values[unknown[0]], f"one of {', '.join(names)}")
    for one in fields:
        value = words.values.get(one.name)
        if not one.takes(value):
            raise OutOfRange(f"word {one.name}", value, one.rule)


def check_limits(values: Mapping[str, Number], low: str, high: str, *, equal: bool = True) -> None:
    """Refuse limits that are upside down, or that are equal where they may not be.

    Args:
        values: word name → value.
        low: name of the word of the lower limit.
        high: likewise of the upper one.
        equal: whether they may be equal.

    Raises:
        OutOfRange: they are.
    """
    if values[low] > values[high] or (values[low] == values[high] and not equal):
        raise OutOfRange(f"word {low}", values[low], f"{'<=' if equal else '<'} {high} = {values[high]:g}")


def no_pid(words: Words) -> None:
    """Return None: the `design` of a controller that is no PID."""


def timer_interval_s(timer: Timer, sample_time_s: float) -> float:
    """Return a sampling interval as a timer keeps it [s].

    Raises:
        NotRepresentable: it cannot; the error tells the nearest one.
    """
    low, high, step = timer.shortest_s, timer.longest_s, timer.step_s
    steps = round(min(max(sample_time_s, low), high) / step)
    if not abs(sample_time_s / step - steps) <= 1e-6:
        raise NotRepresentable("sampling interval TA", sample_time_s, f"{low:g}…{high:g} s in steps of {step:g} s",
                               f"{steps * step:g} s would fit (tune --sample-time {steps * step:g})")
    return round(1000.0 * sample_time_s) / 1000.0


def round_to_word(
    field: WordField, exact: Number, remedy: str = "a size between 1.4e-45 and 3.4e+38 would fit"
) -> Number:
    """Return a number as its word holds it, rounded once: to its precision, or whole with halves away from zero.

    Raises:
        NotRepresentable: it leaves the word's range, or has a fraction and would be rounded to zero.
    """
    if field.format in FLOATS:
        word: Number = single(exact) if field.format == "REAL" else float(exact)
        word = word if field.places is None else round(word, field.places)
        if math.isinf(word) or (word == 0.0 and exact != 0.0):
            raise NotRepresentable(f"word {field.name}", exact, field.kind, remedy)
    else:
        word = round_half_away(exact) if math.isfinite(exact) else exact
    if not field.low <= word <= field.high:
        raise NotRepresentable(f"word {field.name}", word, field.rule, "another design would fit")
    return word


def round_half_away(value: float) -> int:
    """Return the nearest whole number, halves away from zero."""
    return int(math.copysign(math.floor(abs(value) + 0.5), value))


class EntryChange(TypedDict, total=False):
    """What is typed otherwise than it stands in a word, see `heatertune.plc.keyed_entry.KeyedEntry`."""

    format: str
    first: Number
    then: Number
    meaning: str
    first_text: str
    then_text: str


class Cycle(NamedTuple):
    """How words hold the PWM period.

    Attributes:
        of: values → the period [s].
        put: (values, a period [s]) → values with that period; raises OutOfRange where they can't hold it.
        periods_s: that they can hold, rising [s].
    """

    of: Callable[[Mapping[str, Number]], float]
    put: Callable[[Mapping[str, Number], float], Mapping[str, Number]]
    periods_s: tuple[float, ...]


def with_pwm_period(cycle: Cycle | None, words: Words, pwm_period_s: float | None) -> Words:
    """Return words with a PWM period [s]; as they are where none is given, or none is in them.

    Raises:
        OutOfRange: one that they can't hold.
    """
    if cycle is None or pwm_period_s is None:
        return words
    return replace(words, values=cycle.put(words.values, pwm_period_s))
