"""The base class of all controllers, the lookup of a controller by its name, and the words of a cooler.

Subclasses set attributes and implement the abstract methods; everything else is final. Optional hooks default to
None. Proof and chain know nothing else about a controller.
"""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import replace
from functools import cache, partial
from importlib import import_module
from typing import Any, ClassVar, Final, NamedTuple, cast, final

from heatertune.errors import InputError, OutOfRange, UnknownName
from heatertune.pid.design_values import PidDesign, Timer
from heatertune.plc.core import ControllerState, RunningController, Scan, StepFunctions, Timing
from heatertune.plc.exported import Loads
from heatertune.plc.feed_forward import FeedForwardHooks
from heatertune.plc.inputs import Inputs
from heatertune.plc.open_points import NothingOpen, OpenPoint, assumptions_from, open_points_of
from heatertune.plc.pwm import Actuator
from heatertune.plc.ramp import Number, Ramp, nearest
from heatertune.plc.readback import ReadBack
from heatertune.plc.single_precision import single
from heatertune.plc.targets import COOLING, NAMES, target_by_name
from heatertune.plc.words import (
    Certificate,
    Cycle,
    EntryChange,
    Scaling,
    WordField,
    Words,
    check_fields,
    round_to_word,
    timer_interval_s,
)
from heatertune.units import check

__all__ = ["Controller", "CoolingSupport", "SetpointHandling", "controller_for", "with_cooler", "with_cooling"]


class SetpointHandling(Inputs):
    """A controller whose setpoint is led; see `heatertune.plc.controller.Controller`, which explains the attributes."""

    name: ClassVar[str]
    core: ClassVar[StepFunctions]
    scans_per_period: ClassVar[int | None] = None
    cycle: ClassVar[Cycle | None] = None
    has_ramp: ClassVar[bool] = False
    has_boost: ClassVar[bool] = False

    @final
    def timing(self, words: Words) -> Timing:
        """Return when the controller wants to be called."""
        ta, scans = words.sample_time_s, self.scans_per_period
        period = self.cycle.of(words.values) if self.cycle is not None else None if scans is None else ta
        return Timing(scan_s=ta / (scans or 1), pwm_period_s=period)

    @final
    def ramp(self, words: Words, rate_degC_per_min: float, hold_degC: float | None = None) -> Ramp:
        """Return the setpoint ramp near a rate [°C/min] and a holdback [°C]; None: none, below zero: a cooler's.

        Raises:
            InputError: this controller has no ramp.
            OutOfRange: a rate that is not positive, so slow that the word would not move, or so fast that one step
                crosses the sensor's range; a holdback of nothing or one that crosses it.
        """
        if not self.has_ramp:
            raise InputError(f"{self.name} has no setpoint ramp (see: heatertune targets)")
        check("setpoint_ramp_degC_per_min", rate_degC_per_min, above=0.0)
        low, high = self.ends(words)
        per_degree = (high - low) / words.scaling.span_degC
        per_call = rate_degC_per_min / 60.0 * self.timing(words).scan_s * per_degree
        ramp = nearest(per_call, whole=isinstance(high, int), least=(high - low) / self.sensor(words.scaling).counts)
        if not ramp.step < high - low:
            rule = f"< {rate_degC_per_min * (high - low) / per_call:.4g}, the sensor's whole range in one call"
            raise OutOfRange("setpoint_ramp_degC_per_min", rate_degC_per_min, rule)
        if hold_degC is None:
            return ramp
        check("setpoint_hold_degC", abs(hold_degC), above=0.0, most=words.scaling.span_degC)
        size = abs(hold_degC) * per_degree
        hold = max(1, round(size)) if isinstance(high, int) else single(size)
        return replace(ramp, hold=-hold if hold_degC < 0.0 else hold)

    @final
    def ramp_degC_per_min(self, words: Words) -> float:
        """Return how fast the words' ramp moves the setpoint [°C/min], infinite without one."""
        if words.ramp is None:
            return math.inf
        low, high = self.ends(words)
        per_call = words.ramp.step * words.scaling.span_degC / (high - low) / words.ramp.calls
        return 60.0 * per_call / self.timing(words).scan_s

    @final
    def check_ramp(self, words: Words) -> None:
        """Refuse words whose ramp or boost the controller cannot follow.

        Raises:
            InputError: this controller has none.
            OutOfRange: a step or holdback that the setpoint word cannot take.
        """
        if words.boost is not None and not self.has_boost:
            raise InputError(f"{self.name} has no boost (see: heatertune targets)")
        if words.ramp is None:
            return
        if not self.has_ramp:
            raise InputError(f"{self.name} has no setpoint ramp (see: heatertune targets)")
        low, high = self.ends(words)
        least = 1 if isinstance(high, int) else single((high - low) / self.sensor(words.scaling).counts)
        if isinstance(words.ramp.step, int) != isinstance(high, int) or not least <= words.ramp.step < high - low:
            kind = "a whole number" if isinstance(high, int) else "a number in single precision"
            raise OutOfRange("ramp step", words.ramp.step, f"{kind} from {least:.4g} to below {high - low:g}")
        if words.ramp.hold is not None:
            check("ramp hold", abs(words.ramp.hold), least=least, most=high - low)

    @final
    def hold_degC(self, words: Words) -> float | None:
        """Return how far from the reading the words' ramp lets the setpoint be [°C], None without a holdback."""
        if words.ramp is None or words.ramp.hold is None:
            return None
        low, high = self.ends(words)
        return abs(words.ramp.hold) * words.scaling.span_degC / (high - low)

    @final
    def ends(self, words: Words) -> tuple[Number, Number]:
        """Return the readings at the ends of the sensor's range [units]."""
        its, measure = self.sensor(words.scaling)._replace(least=0, half=0.0), self.core.measure
        # beyond the range the module limits: at its end the last digit may fall short
        return measure(its, its.low - its.span), measure(its, its.low + 2.0 * its.span)

    @final
    def measure(self, words: Words, temperature_degC: float) -> Number:
        """Return the reading for a temperature, quantised and limited as the input module does [units]."""
        return cast("Number", self.core.measure(self.sensor(words.scaling), temperature_degC))


#: target → its class, entered where the class is made
_CLASSES: Final[dict[str, type[Controller]]] = {}


class CoolingSupport(NamedTuple):
    """What a controller with an output for a cooler knows of it.

    Attributes:
        words: (words, full power of the cooler as a part of the heater's) → words for that cooler.
        gain: words → what they say of that part; raises OutOfRange where they don't.
        design: words → the design that cools, as `Controller.design`.
    """

    words: Callable[[Words, float], Words]
    gain: Callable[[Words], float]
    design: Callable[[Words], PidDesign | None]


class Controller(SetpointHandling, ABC):
    """One controller, as `class Ob251(Controller, name="s5-ob251")`; the class registers itself under its name.

    Attributes:
        name: on the command line.
        title: controller, manual and edition.
        main_file: the file of the export that a person loads or enters first: it has all words.
        fields: the words, in the order in which they are typed in.
        inputs: what one scan reads, in the controller's units: name → format; the first two are setpoint and reading.
        written: names of words that the program around writes while it runs, so that no proof is of them.
        input_ranges: input name → its smallest and largest value, where its format holds more.
        can: what the controller can do, one sentence each.
        cannot: what it can't do, or what is left out here, one sentence each.
        counts: steps of the input module over the sensor range.
        ranges: name → range of the analog module that the export can read beside a plain one.
        unread: name of a range that it cannot read → why.
        timer: the sampling intervals that the target's timer can make.
        core: what `step` and `measure` compute.
        assumptions: what the manual leaves open, see `heatertune.plc.open_points`.
        derivative_filter: weight of its own past in the derivative part, see `PidDesign`; ½ where there is none.
        scans_per_period: scans in one period of the PWM that the controller makes itself, which is its sampling
            interval; None: one scan per sampling interval, and the PWM is an actuator behind the output.
        cycle: how the words hold the period of the PWM that the controller makes itself; None: they don't.
        ramped, boosted: whether the export brings the program of a setpoint ramp along, of a boost.
        integers: the whole numbers that make its control law and that a search may move: the word of the gain first,
            the one of the I part second, the one of the D part third; None: there is nothing to gain over rounding.
        most_gain: (scaling, design) → the largest K in size that the words hold beside its times [%/°C]; None: any of
            use.
        most_power: (word that limits the output from above, its value at 100 %); None: there is none.
        window: word that holds how far below the setpoint a firmware hands over from full power to the PID [°C]; None:
            there is none.
        baseline: target of the two-level control that a report holds it against; None: it is that one.
        interval_s: values → the sampling interval that the words themselves hold [s]; None: they hold none, or another
            than the real one is allowed.
        consistent: raises OutOfRange for words that each are in range, but not together; None: all go together.
        image: (memory of a running controller, sample_time_s, source) → values; raises InputError where its length is
            wrong; None: words cannot be read back.
        tolerated: as `consistent`, for words that were read from a machine: what its manual allows under a condition of
            the process raises nothing; None: as `consistent`.
        exported: (files of the export, assumptions) → file → what loads its program, see `heatertune.plc.exported`,
            without files that are of other assumptions; None: no CPU here runs them.
        text: text that a programming tool saves or prints, the sampling interval [s] (None: the words tell it) and a
            name for error messages → the words; None: they cannot be read back from text.
        text_of_heater: as `text`, with the setting of the open point `heater`; None: a text holds one controller alone.
        oddities: what is odd about a running controller's words, one sentence each; None: nothing is known to be.
        premises: what words leave to the program around, a phrase each; None: nothing.
        faults: what is known to be wrong in the controller with these words, one sentence each; None: nothing.
        tick_s: of the clock behind calls and PWM, the coarsest [s]; None: the export's program makes no PWM.
        pwm_period_s: of the switch behind the output where the user says none [s]; None: TA in parts up to 10 s.
        own_pwm: where the user tells no switch: its rule (None: plain) and longest period (infinite: TA) [s].
        delay_s: longest time from a temperature to its reading and from the controller's output to the heater's switch,
            as input module and exported program make it; part of the dead time in a proof [s].
        direct: for a core that runs a listing, which no compiler takes: words and assumptions → a core that gives the
            same, its parameters and cold state; None: the core itself compiles, or none does.
        feed: the input that a measured disturbance is written to; None: there is none.
        typed: (words, setpoint of the proof [°C], the same in units; None without a proof) → word → what of its
            `heatertune.plc.keyed_entry.KeyedEntry` is other than the words and their fields say; None: nothing.
        setpoint_entry: (words, setpoint of the proof [°C], the same in units) → the setpoint as a person enters
            it, with its unit; None: in °C where the controller's setpoint is a REAL, else its word.
        cooling: what is known of the cooler beside the heater; None: the controller has no output for one.
        scan_all: (parameters, state, all inputs) → what the core's `step` gives, those not named being as the words
            have them; None: there are no inputs but `step`'s.
    """

    name: ClassVar[str]
    title: ClassVar[str]
    main_file: ClassVar[str]
    fields: ClassVar[tuple[WordField, ...]]
    inputs: ClassVar[Mapping[str, str]]
    written: ClassVar[tuple[str, ...]] = ()
    input_ranges: ClassVar[Mapping[str, tuple[Number, Number]]] = {}
    can: ClassVar[tuple[str, ...]]
    cannot: ClassVar[tuple[str, ...]]
    counts: ClassVar[int]
    timer: ClassVar[Timer]
    core: ClassVar[StepFunctions]
    assumptions: ClassVar[type[NamedTuple]] = NothingOpen
    derivative_filter: ClassVar[float] = 0.5
    integers: ClassVar[tuple[str, str, str] | None] = None
    most_gain: ClassVar[staticmethod[[Scaling, PidDesign], float] | None] = None
    most_power: ClassVar[tuple[str, Number] | None] = None
    window: ClassVar[str | None] = None
    baseline: ClassVar[str | None] = "on-off"
    interval_s: ClassVar[staticmethod[[Mapping[str, Number]], float] | None] = None
    consistent: ClassVar[staticmethod[[Words], None] | None] = None
    image: ClassVar[staticmethod[[bytes, float, str], Mapping[str, Number]] | None] = None
    check_consistency: ClassVar[staticmethod[[Words], None] | None] = None
    load_exported: ClassVar[staticmethod[[Mapping[str, str | bytes], Any], Loads] | None] = None
    text: ClassVar[staticmethod[[str, float | None, str], ReadBack] | None] = None
    text_of_heater: ClassVar[staticmethod[[str, float | None, str, str], ReadBack] | None] = None
    oddities: ClassVar[staticmethod[[Words], tuple[str, ...]] | None] = None
    premises: ClassVar[staticmethod[[Words], tuple[str, ...]] | None] = None
    faults: ClassVar[staticmethod[[Words], tuple[str, ...]] | None] = None
    tick_s: ClassVar[float | None] = None
    pwm_period_s: ClassVar[float | None] = None
    own_pwm: ClassVar[tuple[str | None, float]] = (None, 10.0)
    direct: ClassVar[staticmethod[[Words, Any], tuple[StepFunctions, ControllerState]] | None] = None
    feed: ClassVar[FeedForwardHooks | None] = None
    keyed_entries: ClassVar[staticmethod[[Words, float | None, Any], Mapping[str, EntryChange]] | None] = None
    setpoint_entry: ClassVar[staticmethod[[Words, float, Any], str] | None] = None
    cooling: ClassVar[CoolingSupport | None] = None
    scan_all: ClassVar[staticmethod[[Any, Any, Mapping[str, Any]], tuple[Any, float, Any, int]] | None] = None

    def __init_subclass__(cls, *, name: str) -> None:
        """Register the class; raise TypeError where it does not say what it must, or takes another's name."""
        super().__init_subclass__()
        cls.name = name
        unsaid = [attribute for attribute in Controller.__annotations__ if not hasattr(cls, attribute)]
        if unsaid:
            raise TypeError(f"{cls.__name__} does not say its {', '.join(unsaid)}")
        if name in NAMES and cls.__module__ != f"{NAMES[name]}.controller":
            raise TypeError(f"{cls.__name__}: {name} is a controller of heatertune; take another name")
        open_points_of(cls.assumptions)
        _CLASSES[name] = cls

    @staticmethod
    @abstractmethod
    def values(design: PidDesign, scaling: Scaling) -> Mapping[str, Number]:
        """Return all words of a design whose TA the timer keeps, as they come out; `encode` rounds them.

        Raises:
            NotRepresentable: rounding would switch a wanted part off, or what is more than a word out of its range.
        """

    @staticmethod
    @abstractmethod
    def design(words: Words) -> PidDesign | None:
        """Return the design that words run, which have been checked; None where the controller is no PID.

        Raises:
            OutOfRange: words that have no standard form.
        """

    @staticmethod
    @abstractmethod
    def export(words: Words, certificate: Certificate) -> Mapping[str, str | bytes]:
        """Return file name → content; the same words and certificate always give the same bytes."""

    @abstractmethod
    def begin(self, words: Words, assume: Any) -> ControllerState:
        """Return the cold state under the assumptions, a value of `assumptions`."""

    @property
    @final
    def switches(self) -> tuple[OpenPoint, ...]:
        """What the manual leaves open, as users see it."""
        return tuple(open_points_of(self.assumptions).values())

    @final
    def encode(self, design: PidDesign, scaling: Scaling) -> Words:
        """Return the words nearest to a design, each rounded once.

        Raises:
            NotRepresentable: TA is no interval of the timer, or a word does not fit; it tells what would.
        """
        ta_s, fields = timer_interval_s(self.timer, design.sample_time_s), {field.name: field for field in self.fields}
        values = {name: round_to_word(fields[name], value) for name, value in self.values(design, scaling).items()}
        interval_s = ta_s if self.interval_s is None else self.interval_s(values)
        return Words(target=self.name, values=values, scaling=scaling, sample_time_s=interval_s)

    @final
    def decode(self, words: Words) -> PidDesign | None:
        """Return the design that words run; None where the controller, or what they make of it, is no PID.

        Raises:
            OutOfRange: as `check`; words that have no standard form.
        """
        self.check(words)
        return self.design(words)

    def again_degC(self, words: Words) -> float | None:
        """Return how far below the setpoint full power takes the heater back, as a boost does [°C]; None: nowhere."""
        return None if words.boost is None else words.boost.again_degC

    @final
    def most_power_pct(self, words: Words) -> float:
        """Return the most power that words ask for [%]."""
        if self.most_power is None:
            return 100.0
        name, full = self.most_power
        return 100.0 * words.values[name] / full

    def forgets_degC(self, words: Words) -> float | None:  # noqa: ARG002 - a window is a word
        """Return how far below the setpoint the sum is forgotten, as a window ends [°C]; None: nowhere."""
        return None

    @final
    def with_output_limit(self, words: Words, most_pct: float) -> Words:
        """Return words that never ask for more power than that [%].

        Raises:
            OutOfRange: the controller has no word for it, or none of that value.
        """
        if self.most_power is None:
            raise OutOfRange("largest power", most_pct, f"100 %: {self.name} has no word that limits its output")
        name, full = self.most_power
        value, field = full * most_pct / 100.0, next(field for field in self.fields if field.name == name)
        value = round(value) if isinstance(full, int) else field.cut(value)
        limited = replace(words, values={**words.values, name: value})
        self.check(limited)
        return limited

    @final
    def with_window(self, words: Words, window_degC: float) -> Words:
        """Return words that hand over to the PID so far from the setpoint [°C], rounded to what the word holds.

        Raises:
            OutOfRange: the controller has no word for it, or none of that value.
        """
        if self.window is None:
            raise OutOfRange("window", window_degC, f"none: {self.name} has no word for it")
        wider = replace(words, values={**words.values, self.window: round(window_degC)})
        self.check(wider)
        return wider

    @final
    def check(self, words: Words) -> None:
        """Refuse words that the controller cannot hold.

        Raises:
            OutOfRange: the first word that is missing, unknown, of the wrong kind or out of its range; words that
                contradict one another, or another interval than they hold.
        """
        check_fields(self.fields, words)
        if self.consistent is not None:
            self.consistent(words)
        check("sample_time_s", words.sample_time_s, above=0.0)
        interval_s = words.sample_time_s if self.interval_s is None else self.interval_s(words.values)
        if abs(words.sample_time_s - interval_s) > 1e-9:
            raise OutOfRange("sample_time_s", words.sample_time_s, f"what the words hold, {interval_s:g} s")

    @final
    def read_image(self, image: bytes, *, sample_time_s: float, scaling: Scaling, source: str) -> Words:
        """Return the words in the memory of a running controller.

        Args:
            image: bytes of the memory, as `image` takes them.
            sample_time_s: interval at which it is called [s], whatever the words say.
            scaling: sensor range; no memory holds it.
            source: name for error messages.

        Raises:
            InputError: a memory of the wrong length, or of a controller whose words cannot be read back.
            OutOfRange: a word outside its field's range; what words mean together `check` and `oddities` tell.
        """
        if self.image is None:
            raise InputError(f"{source}: words of {self.name} cannot be read back")
        values = self.image(image, sample_time_s, source)
        words = Words(target=self.name, values=values, scaling=scaling, sample_time_s=sample_time_s)
        check_fields(self.fields, words)
        return words

    @final
    def start(self, words: Words, switches: Mapping[str, str]) -> ControllerState:
        """Return the controller in the cold state for these settings; switches not named have their default.

        Raises:
            UnknownName: a switch or setting that is not there.
        """
        return self.begin(words, assumptions_from(self.assumptions, switches))

    @final
    def instantiate(self, words: Words, switches: Mapping[str, str]) -> RunningController:
        """Return the controller in the cold state, to be called scan by scan, its setpoint ramp included.

        Raises:
            OutOfRange, InputError: as `check` and `check_ramp`.
            UnknownName: as `start`.
        """
        self.check(words)
        self.check_ramp(words)
        return RunningController(
            begin=self.start(words, switches), step=self.step, measure=partial(self.measure, words),
            timing=self.timing(words), ramp=words.ramp)

    @final
    def start_directly(self, words: Words, switches: Mapping[str, str]) -> tuple[StepFunctions, ControllerState]:
        """Return what `start` does, without the listing where that can be, and the core that runs it."""
        if self.direct is None:
            return self.core, self.start(words, switches)
        return self.direct(words, assumptions_from(self.assumptions, switches))

    @final
    def step(
        self, running: ControllerState, setpoint: Any, reading: Any, *, cycle_start: bool = True
    ) -> tuple[ControllerState, Scan]:
        """Run one scan; pure, total for every bit pattern.

        `setpoint` and `reading` are in the controller's units; `cycle_start` tells a controller that makes
        its own PWM that a PWM period begins with this scan.
        """
        return self.core.run(running, setpoint, reading, cycle_start=cycle_start)

    @final
    def scan(self, running: ControllerState, inputs: Mapping[str, Any]) -> tuple[ControllerState, Scan]:
        """Run one scan on all of its inputs; those not named stay as the words have them. Pure, as `step`."""
        if self.scan_all is None:
            setpoint, reading, *_ = self.inputs
            return self.step(running, inputs[setpoint], inputs[reading], cycle_start=bool(inputs.get("CYCLE_START", 1)))
        state, *outcome = self.scan_all(running.parameters, running.state, inputs)
        return ControllerState(running.parameters, state), self.core.scan_result(outcome)


def controller_for(target: str) -> Controller:
    """Return the controller of a target.

    Raises:
        UnknownName: no such target.
    """
    target = target_by_name(target) if target not in _CLASSES else target
    if target in NAMES:
        import_module(f"{NAMES[target]}.controller")
    if target not in _CLASSES:
        raise UnknownName("target", target, NAMES | _CLASSES)
    return _instance(_CLASSES[target])


@cache
def _instance(kind: type[Controller]) -> Controller:
    return kind()


def with_cooling(words: Words, cooling_gain: float | None) -> Words:
    """Return words for a cooler whose full power is so many times the heater's; as they are where none is told.

    Raises:
        NotRepresentable: a gain that they can't hold.
    """
    cooling = controller_for(words.target).cooling
    return words if cooling is None or cooling_gain is None else cooling.words(words, cooling_gain)


def with_cooler(
    actuator: Actuator, words: Words, cooling_gain: float | None, *, minimum_on_s: float | None = None,
    minimum_off_s: float | None = None,
) -> Actuator:
    """Return a switch with the cooler's where the controller has an output for one.

    Args:
        actuator: of the heater.
        words: that run.
        cooling_gain: full power of the cooler as a part of the heater's; None: as the words say.
        minimum_on_s: shortest pulse of the cooler; None: any [s].
        minimum_off_s: its shortest pause [s].

    Raises:
        InputError: a cooler that the controller has no output for.
        OutOfRange: words that don't say how strong it is, or times that leave no pulse.
    """
    cooling = controller_for(words.target).cooling
    if cooling is None:
        if cooling_gain is not None:
            raise InputError(f"{words.target} has no second output for a cooler; {', '.join(COOLING.values())} has one")
        return actuator
    gain = cooling.gain(words) if cooling_gain is None else cooling_gain
    return replace(actuator, cooling_gain=gain, cooling_minimum_on_s=minimum_on_s, cooling_minimum_off_s=minimum_off_s)
