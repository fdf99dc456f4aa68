"""The doors of a room, written down once.

A room is one controller. Its four doors are `encode` (design → words), `decode` (words → the design the PLC will
really run), `step` (one scan in the PLC's own arithmetic) and `export` (words → text). Proof and chain
know rooms only through this file.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any, Final, NamedTuple, Protocol, cast, final

from heatertune.errors import InputError, OutOfRange
from heatertune.pid.values import PidDesign
from heatertune.plc.open_points import Switch, assumed, declared
from heatertune.plc.ramp import Number, Ramp, nearest
from heatertune.plc.single import is_single, single
from heatertune.show import Shown
from heatertune.units import check

__all__ = [
    "FORMATS", "Certificate", "Core", "Number", "Room", "Running", "Scaling", "Scan", "Sensor", "Timing", "WordField",
    "Words", "check_fields", "count", "holds",
]

#: format of a number in a controller → smallest and largest value; what is not REAL is whole
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
}


#: of a sensor range [°C]: below, a reading is noise alone; no furnace is hotter than the upper one
_LEAST_SPAN_DEGC: Final = 1e-3
_MOST_SPAN_DEGC: Final = 1e5


@dataclass(frozen=True, slots=True, kw_only=True)
class Scaling:
    """How the temperature becomes the controller's number: a linear sensor range.

    Attributes:
        low_degC, high_degC: the temperatures at the lowest and highest reading [°C].

    Raises:
        OutOfRange: a range that is empty or upside down.
    """

    low_degC: float = 0.0
    high_degC: float = 100.0

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


@dataclass(frozen=True, slots=True, kw_only=True)
class WordField:
    """One word of a room: its place, format (see `FORMATS`), range and meaning."""

    name: str
    address: str
    format: str
    low: float
    high: float
    comment: str

    @property
    def rule(self) -> str:
        """What a value must be, as told to people."""
        kind = "a number in single precision" if self.format == "REAL" else "a whole number"
        return f"{kind} {self.low:.9g}…{self.high:.9g}"


@dataclass(frozen=True, slots=True, kw_only=True)
class Words(Shown):
    """The numbers the PLC will hold, for one target.

    Attributes:
        target: the room's name.
        values: word name → number as stored, REALs in single precision.
        scaling: the sensor range the words were made for.
        sample_time_s: interval at which the controller is called [s].
        ramp: how the program around the controller moves its setpoint; None: at once.
    """

    target: str
    values: Mapping[str, Number]
    scaling: Scaling
    sample_time_s: float
    ramp: Ramp | None = None

    @property
    def whole(self) -> Mapping[str, int]:
        """The values, for a controller that holds whole numbers only."""
        return cast("Mapping[str, int]", self.values)


@dataclass(frozen=True, slots=True, kw_only=True)
class Timing:
    """When the room wants to be called.

    Attributes:
        scan_s: interval between two calls of `step` [s].
        pwm_period_s: PWM period where the controller makes the PWM itself [s], else None (the PWM
            is an actuator behind the controller's output).
    """

    scan_s: float
    pwm_period_s: float | None = None


@dataclass(frozen=True, slots=True, kw_only=True)
class Scan:
    """What one scan gave.

    Attributes:
        power_pct: heater power asked for, 0…100 % of full power.
        output: the same in the controller's own units.
        flags: the controller's flags after the scan, name → set?
    """

    power_pct: float
    output: Number
    flags: Mapping[str, bool] = field(default_factory=dict)


@dataclass(frozen=True, slots=True, kw_only=True)
class Certificate:
    """What an export says about its proof.

    Attributes:
        verdict: "PASS", "FAIL" or "NOT PROVEN".
        lines: one line per fact (models proven on, worst criterion, …); no date, no locale.
        forced: whether the words left although the verdict is not PASS.
    """

    verdict: str
    lines: tuple[str, ...] = ()
    forced: bool = False

    @property
    def head(self) -> tuple[str, ...]:
        """The verdict and the facts, one line each, for the head of an exported file."""
        forced = " - FORCED in spite of it" if self.forced else ""
        return (f"verdict of the proof: {self.verdict}{forced}", *self.lines)


def holds(format_: str, value: object) -> bool:
    """Return whether a number can be stored in a format: whole or in single precision, and in its range."""
    if isinstance(value, bool) or not isinstance(value, int | float):
        return False
    low, high = FORMATS[format_]
    return low <= value <= high and (is_single(value) if format_ == "REAL" else isinstance(value, int))


def check_fields(fields: tuple[WordField, ...], words: Words) -> None:
    """Raise OutOfRange for the first word that is missing, unknown, of the wrong kind or outside its field's range."""
    names = [each.name for each in fields]
    unknown = sorted(set(words.values) - set(names))
    if unknown:
        raise OutOfRange(f"word {unknown[0]}", words.values[unknown[0]], f"one of {', '.join(names)}")
    for each in fields:
        value = words.values.get(each.name)
        if value is None or not holds(each.format, value) or not each.low <= value <= each.high:
            raise OutOfRange(f"word {each.name}", value, each.rule)


class Sensor(NamedTuple):
    """The input module: lowest temperature and span [°C], and its highest count."""

    low: float
    span: float
    counts: int


def count(sensor: Sensor, temperature_degC: float) -> int:
    """Return the count of a temperature, cut towards zero as a converter does, limited to 0…`counts`."""
    return int(min(max((temperature_degC - sensor.low) * sensor.counts / sensor.span, 0.0), float(sensor.counts)))


class Running(NamedTuple):
    """A controller that runs: what its words and switches made of its core's parameters, and its memory."""

    parameters: Any
    state: Any


@dataclass(frozen=True, slots=True, kw_only=True)
class Core:
    """How a controller computes, as plain functions of numbers and named tuples that a compiler takes as they are.

    Attributes:
        step: (parameters, state, setpoint, reading, whether a PWM period begins) → (state, power 0…100 %, output in
            the controller's units, flags as bits in the order of `flags`); total for every bit pattern.
        measure: (sensor, temperature [°C]) → reading.
        flags: names of the flags, the lowest bit first.
        compiles: whether a compiler takes it.
        singles: whether all floats of parameters, state and setpoint are REALs: a compiled step may then be given them
            in single precision.
    """

    step: Callable[[Any, Any, Any, Any, bool], tuple[Any, float, Any, int]]
    measure: Callable[[Any, float], Any]
    flags: tuple[str, ...]
    compiles: bool = True
    singles: bool = False

    def run(self, running: Running, setpoint: Any, reading: Any, *, cycle_start: bool) -> tuple[Running, Scan]:
        """Run one scan."""
        state, *told = self.step(running.parameters, running.state, setpoint, reading, cycle_start)
        return Running(running.parameters, state), self.told(told)

    def told(self, told: Sequence[Any]) -> Scan:
        """Return what `step` told beside the state, the flags by name."""
        power_pct, output, bits = told
        flags = {name: bool(bits >> place & 1) for place, name in enumerate(self.flags)}
        return Scan(power_pct=power_pct, output=output, flags=flags)


class ReadImage(Protocol):
    """Memory → words."""

    def __call__(self, image: bytes, *, sample_time_s: float, scaling: Scaling, source: str) -> Words:
        """Return the words of a dump; raise InputError where its length is wrong, OutOfRange for a word."""


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Room(ABC):
    """One controller: what it is, its doors between design, words and text, and, in its subclass, how it runs.

    Attributes:
        name: on the command line.
        title: controller, manual and edition.
        fields: the words, in the order in which they are typed in.
        assumptions: what the manual leaves open, see `heatertune.plc.open_points`.
        inputs: what one scan reads, in the controller's units: name → format; the first two are setpoint and reading.
        can: what the controller can do, one sentence each.
        cannot: what it can't do, or what this room leaves out, one sentence each.
        counts: steps of the input module over the sensor range.
        sample_times_s: shortest, longest and step of the sampling interval the target's timer can do [s].
        derivative_filter: weight of its own past in the derivative part, see `PidDesign`; ½ where there is none.
        encode: rounds a design to words, once; raises NotRepresentable for what does not fit.
        decode: words → the design as they realise it; None where the controller is no PID.
        check: raises OutOfRange naming the first word that is missing, unknown, of the wrong kind or out of its range.
        export: words → file name → content; the same words and certificate always give the same bytes.
        core: what `step` and `measure` compute.
        read_image: memory of a running controller → words; None where they cannot be read back.
        oddities: what is odd about a controller's words, one sentence each; None without `read_image`.
        faults: what is known to be wrong in the controller with these words, one sentence each; None: nothing.
        direct: for a core that runs a listing, which no compiler takes: words and assumptions → a core that gives the
            same power, output and flags, and its parameters and cold state; None: the core itself compiles, or none
            does.
        ramped: whether the export brings the program of a setpoint ramp along.
    """

    name: str
    title: str
    fields: tuple[WordField, ...]
    assumptions: type[NamedTuple]
    inputs: Mapping[str, str]
    can: tuple[str, ...]
    cannot: tuple[str, ...]
    counts: int
    sample_times_s: tuple[float, float, float]
    derivative_filter: float
    encode: Callable[[PidDesign, Scaling], Words]
    decode: Callable[[Words], PidDesign | None]
    check: Callable[[Words], None]
    export: Callable[[Words, Certificate], Mapping[str, str | bytes]]
    core: Core
    read_image: ReadImage | None = None
    oddities: Callable[[Words], tuple[str, ...]] | None = None
    faults: Callable[[Words], tuple[str, ...]] | None = None
    direct: Callable[[Words, Any], tuple[Core, Running]] | None = None
    ramped: bool = False

    def __post_init__(self) -> None:
        declared(self.assumptions)

    @property
    def switches(self) -> tuple[Switch, ...]:
        """What the manual leaves open, as users see it."""
        return tuple(declared(self.assumptions).values())

    def ramp(self, words: Words, rate_degC_per_min: float) -> Ramp:
        """Return the setpoint ramp that comes near a rate [°C/min].

        Raises:
            InputError: this room has no ramp.
            OutOfRange: a rate that is not positive, so slow that the word would not move, or so fast that one step
                crosses the sensor's range.
        """
        if not self.ramped:
            raise InputError(f"{self.name} has no setpoint ramp (see: heatertune targets)")
        check("setpoint_ramp_degC_per_min", rate_degC_per_min, above=0.0)
        low, high = self._ends(words)
        per_degree = (high - low) / words.scaling.span_degC
        per_call = rate_degC_per_min / 60.0 * self.timing(words).scan_s * per_degree
        found = nearest(per_call, whole=isinstance(high, int), least=(high - low) / self.counts)
        if not found.step < high - low:
            fastest = 60.0 * words.scaling.span_degC / self.timing(words).scan_s
            raise OutOfRange("setpoint_ramp_degC_per_min", rate_degC_per_min,
                             f"< {fastest:.4g}, the sensor's whole range in one call")
        return found

    def ramp_degC_per_min(self, words: Words) -> float:
        """Return how fast the words' ramp moves the setpoint [°C/min], infinite without one."""
        if words.ramp is None:
            return math.inf
        low, high = self._ends(words)
        per_call = words.ramp.step * words.scaling.span_degC / (high - low) / words.ramp.calls
        return 60.0 * per_call / self.timing(words).scan_s

    def check_ramp(self, words: Words) -> None:
        """Raise OutOfRange for a ramp that this room's setpoint word cannot follow, InputError where it has none."""
        if words.ramp is None:
            return
        if not self.ramped:
            raise InputError(f"{self.name} has no setpoint ramp (see: heatertune targets)")
        low, high = self._ends(words)
        least = 1 if isinstance(high, int) else single((high - low) / self.counts)
        if isinstance(words.ramp.step, int) != isinstance(high, int) or not least <= words.ramp.step < high - low:
            kind = "a whole number" if isinstance(high, int) else "a number in single precision"
            raise OutOfRange("ramp step", words.ramp.step, f"{kind} from {least:.4g} to below {high - low:g}")

    def _ends(self, words: Words) -> tuple[Number, Number]:
        return self.measure(words, words.scaling.low_degC), self.measure(words, words.scaling.high_degC)

    @abstractmethod
    def timing(self, words: Words) -> Timing:
        """Return when the room wants to be called."""

    def sensor(self, words: Words) -> Sensor:
        """Return the input module as the core's `measure` takes it."""
        return Sensor(words.scaling.low_degC, words.scaling.span_degC, self.counts)

    def measure(self, words: Words, temperature_degC: float) -> Number:
        """Return the reading for a temperature, quantised and limited as the input module does [units]."""
        return cast("Number", self.core.measure(self.sensor(words), temperature_degC))

    @final
    def start(self, words: Words, switches: Mapping[str, str]) -> Running:
        """Return the controller in the cold state for these settings; switches not named have their default.

        Raises:
            UnknownName: a switch or setting that is not there.
        """
        return self.begin(words, assumed(self.assumptions, switches))

    @final
    def start_directly(self, words: Words, switches: Mapping[str, str]) -> tuple[Core, Running]:
        """Return what `start` does, without the listing where that can be, and the core that runs it."""
        if self.direct is None:
            return self.core, self.start(words, switches)
        return self.direct(words, assumed(self.assumptions, switches))

    @abstractmethod
    def begin(self, words: Words, assume: Any) -> Running:
        """Return the cold state under the assumptions, a value of `assumptions`."""

    def step(
        self, state: Running, setpoint: Any, reading: Any, *, cycle_start: bool = True
    ) -> tuple[Running, Scan]:
        """Run one scan; pure, total for every bit pattern.

        `setpoint` and `reading` are in the controller's units; `cycle_start` tells a room that makes
        its own PWM that a PWM period begins with this scan.
        """
        return self.core.run(state, setpoint, reading, cycle_start=cycle_start)

    @abstractmethod
    def scan(self, state: Running, inputs: Mapping[str, Any]) -> tuple[Running, Scan]:
        """Run one scan on all of its inputs; those not named stay as the words have them. Pure, as `step`."""
