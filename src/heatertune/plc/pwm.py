"""The heater's switch: power in percent → time it is on within one PWM period."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass, field
from typing import Final, NamedTuple

from heatertune.codec import LEFT_OUT
from heatertune.errors import OutOfRange, UnknownName
from heatertune.units import check

__all__ = ["HALF_WAVE_S", "INSTANT_S", "RULES", "Actuator", "Switches", "Ticks", "in_ticks", "on_time", "pid_compact",
           "pulse_ends", "pulsegen", "switched_by", "tick_for"]

#: instants closer than this are one instant [s]: far above rounding, far below a PLC's tick
INSTANT_S: Final = 1e-9

#: what a block does with a pulse or pause that is too short, by the block's name; burst firing is no block, but what a
#: power controller does
RULES: Final = {"pulsegen": "drop", "pid-compact": "carry", "burst": "carry"}

_RULES: Final = ("drop", "carry")
#: of 50 Hz mains [s]
HALF_WAVE_S: Final = 0.01
#: of any PWM that drives a heater: an Arduino's fastest is about so short [s]
_SHORTEST_S: Final = 1e-3
#: a period of fewer ticks gets a finer tick: steps of 2 %
_LEAST_TICKS: Final = 50
#: parts of a target's tick, the coarsest first
_PARTS: Final = (1, 2, 5, 10)


class Ticks(NamedTuple):
    """Ticks of one clock from one call of the controller to the next, and in one period of the PWM."""

    per_call: int
    per_period: int


class Switches(NamedTuple):
    """`Actuator.numbers` of a heater and its cooler, and what full cooling is of full heating power; 0: no cooler."""

    heat: tuple[float, float, float, float, bool]
    cool: tuple[float, float, float, float, bool]
    cooling: float


@dataclass(frozen=True, slots=True, kw_only=True)
class Actuator:
    """A switch that holds 0 or 100 % power: relay or solid-state relay behind the controller.

    Attributes:
        pwm_period_s: [s].
        resolution_s: the on time is a multiple of it [s]; 10 ms is one half-wave at 50 Hz, the finest that a
            zero-crossing relay can do.
        minimum_on_s, minimum_off_s: shortest pulse and shortest pause [s].
        minimum_rule: what becomes of a pulse or pause that is too short: "drop" leaves it out for good (PULSEGEN of
            the S7-300), "carry" also makes up the difference, rounding included, in the next period (PID_Compact of
            the S7-1200).
        block: that makes the pulses, one of `RULES`; None: any that does as these numbers say.
        cooling_gain: full power of the cooler that a second such switch, of the same period and steps, holds at 0 or
            100 %, as a part of the heater's full power; None: there is no cooler.
        cooling_minimum_on_s, cooling_minimum_off_s: its shortest pulse and pause; None: any [s].

    Raises:
        OutOfRange: a period below 1 ms, a time that is not positive, a resolution above the period, minimum times that
            leave no pulse, an unknown rule.
        UnknownName: an unknown block.
    """

    pwm_period_s: float
    resolution_s: float = HALF_WAVE_S
    minimum_on_s: float = 0.0
    minimum_off_s: float = 0.0
    minimum_rule: str = "drop"
    block: str | None = field(default=None, metadata=LEFT_OUT)
    cooling_gain: float | None = field(default=None, metadata=LEFT_OUT)
    cooling_minimum_on_s: float | None = field(default=None, metadata=LEFT_OUT)
    cooling_minimum_off_s: float | None = field(default=None, metadata=LEFT_OUT)

    def __post_init__(self) -> None:
        check("pwm_period_s", self.pwm_period_s, least=_SHORTEST_S)
        check("resolution_s", self.resolution_s, above=0.0, most=self.pwm_period_s)
        check("minimum_on_s", self.minimum_on_s, least=0.0, most=self.pwm_period_s)
        check("minimum_off_s", self.minimum_off_s, least=0.0, most=self.pwm_period_s - self.minimum_on_s)
        if self.minimum_rule not in _RULES:
            raise OutOfRange("minimum_rule", self.minimum_rule, " or ".join(repr(rule) for rule in _RULES))
        if self.block is not None and self.block not in RULES:
            raise UnknownName("block of the PWM", self.block, RULES)
        if self.cooling_gain is not None:
            check("cooling_gain", self.cooling_gain, above=0.0)
        on, off = self.cooling_minimum_s
        check("cooling_minimum_on_s", on, least=0.0, most=self.pwm_period_s)
        check("cooling_minimum_off_s", off, least=0.0, most=self.pwm_period_s - on)

    @property
    def summary(self) -> str:
        """The switch in a few words, as the head of an exported file tells it."""
        shortest = [f"no {what} below {time:g} s" for what, time in (
            ("pulse", self.minimum_on_s), ("pause", self.minimum_off_s)) if time > 0.0]
        short = [{"drop": "what is too short is left out", "carry": "what is left out is made up"}[self.minimum_rule]]
        block = [] if self.block is None else [f"as {self.block} does it"]
        return ", ".join([f"PWM period {self.pwm_period_s:g} s in steps of {self.resolution_s:g} s", *shortest,
                          *(short if shortest or self.minimum_rule == "carry" else []), *block, *self._cooler_told])

    @property
    def _cooler_told(self) -> list[str]:
        if self.cooling_gain is None:
            return []
        shortest = [f"no {what} of it below {time:g} s" for what, time in (
            zip(("pulse", "pause"), self.cooling_minimum_s, strict=True)) if time > 0.0]
        return [f"beside it a cooler of {self.cooling_gain:g} times the heater's power", *shortest]

    @property
    def numbers(self) -> tuple[float, float, float, float, bool]:
        """Period, resolution, minimum on and off time [s], and whether the difference is carried."""
        return (
            self.pwm_period_s, self.resolution_s, self.minimum_on_s, self.minimum_off_s, self.minimum_rule == "carry",
        )

    @property
    def switches(self) -> Switches:
        """The numbers of heater and cooler, as the proof's loop takes them."""
        heat = self.numbers
        return Switches(heat, (*heat[:2], *self.cooling_minimum_s, heat[4]), self.cooling_gain or 0.0)

    @property
    def cooling_minimum_s(self) -> tuple[float, float]:
        """Shortest pulse and pause of the cooler [s]."""
        return self.cooling_minimum_on_s or 0.0, self.cooling_minimum_off_s or 0.0

    @property
    def least_pct(self) -> float:
        """The least power that can be asked for, of the cooler below 0 [%]."""
        return 0.0 if self.cooling_gain is None else -100.0

    def ticks(self, sample_time_s: float) -> Ticks | None:
        """Return how a clock that ticks at the resolution makes a controller's calls and periods; None: it cannot."""
        counts = [time / self.resolution_s for time in (sample_time_s, self.pwm_period_s)]
        per_call, per_period = map(round, counts)
        if max(abs(per_call - counts[0]), abs(per_period - counts[1])) > INSTANT_S:
            return None
        return Ticks(per_call, per_period)


def in_ticks(time_s: float, tick_s: float | None) -> bool:
    """Return whether a time is whole ticks of a target's finest clock, a tenth of `Controller.tick_s`; None: any is."""
    return tick_s is None or _whole(time_s * _PARTS[-1] / tick_s)


def tick_for(tick_s: float | None, *, sample_time_s: float, pwm_period_s: float) -> float:
    """Return the resolution of a switch whose user tells none [s].

    It is the coarsest part of the target's tick of which both times are whole multiples and that makes at least fifty
    steps of a period; where none makes so many, the finest; a half-wave of 50 Hz where none fits.

    Args:
        tick_s: `Controller.tick_s`.
        sample_time_s: TA [s].
        pwm_period_s: [s].
    """
    ticks = [] if tick_s is None else [tick_s / part for part in _PARTS]
    fit = [tick for tick in ticks if _whole(sample_time_s / tick) and _whole(pwm_period_s / tick)]
    enough = (tick for tick in fit if pwm_period_s / tick > _LEAST_TICKS - INSTANT_S)
    return next(enough, fit[-1] if fit else min(HALF_WAVE_S, pwm_period_s))


def _whole(count: float) -> bool:
    return round(count) > 0 and abs(round(count) - count) <= INSTANT_S * max(1.0, count)


def pulsegen(*, pwm_period_s: float, call_interval_s: float, minimum_s: float = 0.0) -> Actuator:
    """Return the switch behind FB43 PULSEGEN of the S7-300/400, three-step and bipolar modes off.

    A pulse is a whole number of calls (the nearest one: the manual's example does not tell); one shorter than P_B_TM
    is left out, one whose pause would be shorter is on for the whole period, and nothing is made up later (System
    Software for S7-300/400, vol. 2, pp. 27-16…27-22).

    Args:
        pwm_period_s: PER_TM [s].
        call_interval_s: interval at which the block is called [s].
        minimum_s: P_B_TM, of pulse and pause; at least one call [s].
    """
    minimum_s = max(minimum_s, call_interval_s)
    return Actuator(pwm_period_s=pwm_period_s, resolution_s=call_interval_s, minimum_on_s=minimum_s,
                    minimum_off_s=minimum_s, minimum_rule=RULES["pulsegen"], block="pulsegen")


def pid_compact(
    *, pwm_period_s: float, call_interval_s: float, minimum_on_s: float = 0.0, minimum_off_s: float = 0.0
) -> Actuator:
    """Return the switch behind the PWM of PID_Compact of the S7-1200/1500.

    A pulse is a whole number of calls, and so are both minimum times (rounded to the nearest, which the manual does not
    tell); what a pulse that is left out owes is made up in the next period (S7-1200/1500 PID manual, PID_Compact).

    Args:
        pwm_period_s: sampling time of the PID algorithm [s].
        call_interval_s: interval at which the block is called [s].
        minimum_on_s: MinimumOnTime [s].
        minimum_off_s: MinimumOffTime [s].
    """
    calls = [call_interval_s * math.floor(time / call_interval_s + 0.5) for time in (minimum_on_s, minimum_off_s)]
    return Actuator(pwm_period_s=pwm_period_s, resolution_s=call_interval_s, minimum_on_s=calls[0],
                    minimum_off_s=calls[1], minimum_rule=RULES["pid-compact"], block="pid-compact")


def switched_by(
    rule: str | None, *, pwm_period_s: float, resolution_s: float = HALF_WAVE_S, minimum_on_s: float = 0.0,
    minimum_off_s: float = 0.0,
) -> Actuator:
    """Return the switch of a named block, or a plain one that drops what is too short.

    Args:
        rule: one of `RULES`; None: a plain switch.
        pwm_period_s: [s].
        resolution_s: the on time is a multiple of it; of a block, its call interval [s].
        minimum_on_s: shortest pulse [s].
        minimum_off_s: shortest pause [s].

    Raises:
        UnknownName: a rule that does not exist.
        OutOfRange: two minimum times for PULSEGEN, which has one; or as `Actuator`.
    """
    check("resolution_s", resolution_s, above=0.0)
    if rule in (None, "burst"):
        return Actuator(pwm_period_s=pwm_period_s, resolution_s=resolution_s, minimum_on_s=minimum_on_s,
                        minimum_off_s=minimum_off_s, minimum_rule="drop" if rule is None else RULES[rule], block=rule)
    if rule == "pid-compact":
        return pid_compact(pwm_period_s=pwm_period_s, call_interval_s=resolution_s, minimum_on_s=minimum_on_s,
                           minimum_off_s=minimum_off_s)
    if rule != "pulsegen":
        raise UnknownName("PWM rule", rule, RULES)
    if minimum_off_s not in (0.0, minimum_on_s):
        raise OutOfRange("minimum_off_s", minimum_off_s, f"minimum_on_s = {minimum_on_s:g}: PULSEGEN has one P_B_TM")
    return pulsegen(pwm_period_s=pwm_period_s, call_interval_s=resolution_s, minimum_s=minimum_on_s)


def on_time(power_pct: float, carried_s: float, pwm: tuple[float, float, float, float, bool]) -> tuple[float, float]:
    """Return the on time of one period and what is carried to the next [s].

    Args:
        power_pct: power asked for, 0…100 % of full power.
        carried_s: what the periods before owe [s].
        pwm: `Actuator.numbers`.
    """
    period, resolution, minimum_on, minimum_off, carries = pwm
    demand_s = power_pct / 100.0 * period + carried_s
    on = resolution * math.floor(demand_s / resolution + 0.5 + INSTANT_S)
    # neither the pulse wanted nor the rounded one may be too short; nor may its pause
    if min(demand_s, on) < minimum_on - INSTANT_S or on < INSTANT_S:
        on = 0.0
    elif max(demand_s, on) > period - minimum_off + INSTANT_S or on > period - INSTANT_S:
        on = period
    return on, demand_s - on if carries else 0.0


def pulse_ends(actuator: Actuator, power_pct: Callable[[int], float], full: int) -> tuple[int, int]:
    """Return the first of 1…full with a pulse, and the last of 0…full with a pause, nothing being carried over.

    Args:
        actuator: the switch.
        power_pct: of a number, rising with it to 100 % [%].
        full: the number of full power.
    """
    def on(number: int) -> float:
        return on_time(power_pct(number), 0.0, actuator.numbers)[0]

    def first(holds: Callable[[int], bool]) -> int:  # less power never has a longer pulse
        low, high = 0, full
        while high - low > 1:
            middle = (low + high) // 2
            low, high = (low, middle) if holds(middle) else (middle, high)
        return high

    return first(lambda number: on(number) > 0.0), first(lambda number: on(number) >= actuator.pwm_period_s) - 1
