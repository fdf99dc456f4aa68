"""The PID of IEC 61131-3 as its text is printed: words, one call, an exported program that calls it, and its faults.

    e = PV − SP        D = (3·(e − x₃) + x₁ − x₂)/(10·T)        XOUT = KP·((e + S/TR) + D·TD)

In single precision, one rounding per operation. T is TIME_TO_REAL(CYCLE). In automatic S grows by e·T and the three
errors x move on; by hand S is TR·(X0 − e), all x are e and D is 0. In the first call after a start-up S and all x are
0. Nothing is limited, nothing is checked; the faults were found by running it over its inputs.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import Annotated, ClassVar, Final, NamedTuple

from heatertune.errors import InputError, NotRepresentable, OutOfRange
from heatertune.pid.design_values import PidDesign, structure_of
from heatertune.plc.controller import Controller
from heatertune.plc.core import ControllerState, StepFunctions
from heatertune.plc.iec_pid.controller import measure
from heatertune.plc.iec_pid.export import UNITS, constants, setpoint_entry
from heatertune.plc.iec_pid.words import COUNTS, CYCLE_FIELD, TD_FIELD, TIMER, TR_FIELD, interval_s, real_field
from heatertune.plc.keyed_entry import entry_texts
from heatertune.plc.pwm import HALF_WAVE_S
from heatertune.plc.ramp import Number
from heatertune.plc.readback import ReadBack
from heatertune.plc.single_precision import divide_single, single
from heatertune.plc.st.program_text import (
    MILLISECONDS,
    SECONDS,
    TIME_UNIT,
    ProgramLimits,
    clock_for,
    comment,
    head_of,
    instance_call,
    program,
    proven_setpoint,
    statements,
    time_to_real,
    variables,
)
from heatertune.plc.st.readback import ExpectedBlock, words_in
from heatertune.plc.words import FORMATS, Certificate, EntryChange, Scaling, WordField, Words, round_to_word

__all__ = [
    "COLD", "FIELDS", "TEXT", "StandardPid", "StandardPidAssumptions", "StandardPidBlock", "StandardPidState",
    "block_of", "call", "design_of", "entries", "export_words", "faults", "from_text", "scan", "step", "values_of",
]


#: setpoints and readings that are tried [°C], and outputs by hand [%]
_TRIED: Final = range(0, 101)
_FULL: Final = 100.0
#: an error for so many reset times, and one of the other sign until the output comes back
_WINDS: Final = 5
_MOST_CALLS: Final = 100_000


def faults(words: Words) -> tuple[str, ...]:
    """Return the faults that these words bring out, one sentence each, with what was run."""
    b = block_of(words.values, StandardPidAssumptions())
    return tuple(message for message in (
        _sign(b), _by_hand(b), _limits(b), _windup(b), _no_reset(b), _first_call(b), _retuned(b), _unit(words.values),
        _no_number(b)) if message)


def _first(b: StandardPidBlock, error: float) -> float:
    """Return XOUT in the first call in automatic after one by hand at 0 %, with a memory at rest."""
    rest = StandardPidState(0.0, error, error, error)
    return call(b, rest, error, 0.0, True)[1]


def _sign(b: StandardPidBlock) -> str:
    """Return how often the output goes up where the temperature is too high, or down where it is too low."""
    pairs = [(sp, pv) for sp in _TRIED for pv in _TRIED if sp != pv]
    wrong = sum((_first(b, single(pv - sp)) > 0.0) != (sp > pv) for sp, pv in pairs)
    return (f"ERROR is PV - SP: the block heats where it is too warm and stops where it is too cold, in {wrong} of "
            f"{len(pairs)} pairs of setpoint and reading; a heater needs KP below 0") if wrong and b.kp != 0.0 else ""


def _by_hand(b: StandardPidBlock) -> str:
    outputs = [(x0, call(b, COLD, single(-10.0), float(x0), False)[1]) for x0 in _TRIED]
    wrong = [(x0, got) for x0, got in outputs if not abs(got - x0) <= 1e-3 * max(1.0, abs(x0))]
    shown = next(got for x0, got in outputs if x0 == 30)
    return (f"by hand XOUT is KP*X0, not X0: at X0 = 30 it is {shown:.4g}; {len(wrong)} of {len(outputs)} outputs by "
            "hand from 0 to 100 % are wrong") if wrong else ""


def _limits(b: StandardPidBlock) -> str:
    outputs = [_first(b, single(pv - sp)) for sp in _TRIED for pv in _TRIED]
    beyond = sum(not 0.0 <= output <= _FULL for output in outputs)
    return (f"no limits: XOUT is outside 0...100 % for {beyond} of {len(outputs)} pairs of setpoint and reading, with "
            f"an I part of 0 ({min(outputs):.4g}...{max(outputs):.4g} %)") if beyond else ""


def _windup(b: StandardPidBlock) -> str:
    """Return for how long the output stays beyond full power once the reading is above the setpoint."""
    sign, b = -1.0 if b.kp < 0.0 else 1.0, b._replace(td=single(0.0))
    if not (b.tr > 0.0 and b.t > 0.0 and b.kp != 0.0):
        return ""
    error, state, calls = single(50.0 * sign), COLD, min(_MOST_CALLS, math.ceil(_WINDS * b.tr / b.t))
    for _ in range(calls):
        state, output = call(b, state, error, 0.0, True)
    wound, back, above = output, 0, single(-5.0 * sign)
    while output >= _FULL and back < _MOST_CALLS:
        state, output = call(b, state, above, 0.0, True)
        back += 1
    if not wound > _FULL:
        return ""
    longer = "" if back < _MOST_CALLS else "more than "
    sides = ("below", "above") if b.kp < 0.0 else ("above", "below")
    return (f"no anti-windup: after {calls} calls 50 degC {sides[0]} the setpoint XOUT is {wound:.4g} %, and then 5 "
            f"degC {sides[1]} it XOUT comes below 100 % after {longer}{back} calls (without the D part)")


def _no_reset(b: StandardPidBlock) -> str:
    off = b._replace(tr=single(0.0))
    hand, output = call(off, COLD, single(-10.0), 30.0, False)
    then = call(off, hand, single(-10.0), 30.0, True)[1]
    return f"TR = 0 is not off: it divides by TR; by hand XOUT is {output:.4g}, in automatic {then:.4g}"


def _first_call(b: StandardPidBlock) -> str:
    """Return the result of the first call after a start-up, when it is in automatic."""
    if b.td == 0.0:
        return ""
    error, side = (single(-10.0), "below") if b.kp < 0.0 else (single(10.0), "above")
    cold = call(b, COLD, error, 0.0, True)[1]
    return (f"the first call after a start-up takes three errors of 0 for the history: 10 degC {side} the setpoint "
            f"XOUT is {cold:.4g}, with the history of a temperature at rest {_first(b, error):.4g}")


def _retuned(b: StandardPidBlock) -> str:
    """Return how the output jumps where TR alone is changed at rest."""
    if not b.tr > 0.0 or b.kp == 0.0:
        return ""
    state = StandardPidState(single(50.0 / b.kp * b.tr), single(0.0), single(0.0), single(0.0))
    before, after = (call(each, state, single(0.0), 0.0, True)[1] for each in (b, b._replace(tr=single(b.tr / 2.0))))
    return (f"the sum is divided by TR as it is now: at rest, TR from {b.tr:.4g} to {b.tr / 2.0:.4g} s moves XOUT from "
            f"{before:.4g} to {after:.4g}")


def _unit(values: Mapping[str, Number]) -> str:
    seconds, ms = (block_of(values, StandardPidAssumptions(time_unit=unit)) for unit in (0, MILLISECONDS))
    grown = [call(b, COLD, single(1.0), 0.0, True)[0].total for b in (seconds, ms)]
    return (f"the unit of TIME_TO_REAL is not the standard's: one call at 1 degC adds {grown[0]:.4g} to the sum where "
            f"it gives seconds, {grown[1]:.4g} where it gives ms; the I part is then {grown[1] / grown[0]:.4g} times "
            "as fast, the D part as slow")


def _no_number(b: StandardPidBlock) -> str:
    broken, _ = call(b, COLD, math.nan, 0.0, True)
    after = broken
    for _ in range(10):
        after, output = call(b, after, single(-1.0), 0.0, True)
    return f"one reading that is no number stays in the sum: ten good ones later XOUT is {output:.4g}"


_LOWEST, _LARGEST = FORMATS["REAL"]
_KP: Final = real_field("KP", _LOWEST, _LARGEST, "gain, % per °C; below 0 for a heater, as ERROR is PV - SP")

FIELDS: Final[tuple[WordField, ...]] = (
    _KP, real_field("TR", 0.0, _LARGEST, "reset time TN, s; 0 gives no number"), TD_FIELD, CYCLE_FIELD)


def values_of(design: PidDesign, scaling: Scaling) -> dict[str, Number]:  # noqa: ARG001 - in °C
    """Return the words of a design, KP with the sign that makes the block heat.

    Raises:
        NotRepresentable: a design without an I part; a number beyond single precision, or one rounded to zero.
    """
    if math.isinf(design.integral_time_s):
        raise NotRepresentable("word TR", 0.0, "above 0: the block divides by it", "a PI or PID would fit")
    return {
        "KP": round_to_word(_KP, -design.gain_pct_per_degC, "a K nearer to 1 %/°C would fit"),
        "TR": round_to_word(TR_FIELD, design.integral_time_s, "a TN nearer to 1 s would fit"),
        "TD": round_to_word(TD_FIELD, design.derivative_time_s, "a TV nearer to 1 s would fit"),
        "CYCLE": round(1000.0 * design.sample_time_s),
    }


def design_of(words: Words) -> PidDesign:
    """Return the design that these words run where nothing saturates and TIME_TO_REAL gives seconds.

    Raises:
        OutOfRange: KP = 0 or TR = 0, which have no standard form.
    """
    v = words.values
    for name in ("KP", "TR"):
        if v[name] == 0.0:
            raise OutOfRange(f"word {name}", v[name], "not 0: " + ("nothing acts" if name == "KP" else "0/0"))
    tn, tv = float(v["TR"]), float(v["TD"])
    return PidDesign(
        gain_pct_per_degC=-float(v["KP"]), integral_time_s=tn, derivative_time_s=tv, sample_time_s=words.sample_time_s,
        structure=structure_of(tn, tv), method="as the words of the block realise it",
    )


class StandardPidAssumptions(NamedTuple):
    """The open points of the standard, see DIFFERENCES.md."""

    time_unit: Annotated[int, TIME_UNIT] = SECONDS


class StandardPidBlock(NamedTuple):
    """The words as the block uses them, and what follows from them alone."""

    kp: float
    tr: float
    td: float
    t: float
    ten_t: float


class StandardPidState(NamedTuple):
    """What the instance keeps from call to call."""

    total: float = 0.0  # ITERM.XOUT
    x1: float = 0.0
    x2: float = 0.0
    x3: float = 0.0


COLD: Final = StandardPidState()


def step(
    parameters: tuple[StandardPidBlock, StandardPidAssumptions], state: StandardPidState, setpoint: float,
    feedback: float, _begins: bool
) -> tuple[StandardPidState, float, float, int]:
    """Compute one scan in automatic, see `heatertune.plc.core.StepFunctions`.

    Args:
        parameters: the block's, and the assumptions.
        state: before the call.
        setpoint: SP, a REAL, °C.
        feedback: PV, a REAL, °C.
        _begins: not looked at: the PWM is behind the output.
    """
    return _outcome(*call(parameters[0], state, single(feedback - setpoint), setpoint, True))


def scan(
    parameters: tuple[StandardPidBlock, StandardPidAssumptions], state: StandardPidState, inputs: Mapping[str, float]
) -> tuple[StandardPidState, float, float, int]:
    """Compute one scan with SP, PV and, where named, X0 and AUTO."""
    error, auto = single(inputs["PV"] - inputs["SP"]), bool(inputs.get("AUTO", 1))
    return _outcome(*call(parameters[0], state, error, inputs.get("X0", 0.0), auto))


def block_of(values: Mapping[str, float], assume: StandardPidAssumptions) -> StandardPidBlock:
    """Return the block for its words; total for any of them."""
    t = time_to_real(int(values["CYCLE"]), assume.time_unit)
    return StandardPidBlock(kp=float(values["KP"]), tr=float(values["TR"]), td=float(values["TD"]), t=t,
                            ten_t=single(10.0 * t))


def call(b: StandardPidBlock, s: StandardPidState, error: float, x0: float, auto: bool) -> tuple[StandardPidState,
                                                                                                 float]:
    """Return the state after one call, and XOUT; total for all inputs.

    Args:
        b: the words.
        s: before the call.
        error: PV − SP, a REAL [°C].
        x0: output by hand, a REAL [%].
        auto: whether the call is in automatic.
    """
    if auto:
        total = single(s.total + single(error * b.t))
        slope = divide_single(single(single(single(3.0 * single(error - s.x3)) + s.x1) - s.x2), b.ten_t)
        after = StandardPidState(total, error, s.x1, s.x2)
    else:
        total, slope = single(b.tr * single(x0 - error)), single(0.0)
        after = StandardPidState(total, error, error, error)
    parts = single(single(error + divide_single(total, b.tr)) + single(slope * b.td))
    return after, single(b.kp * parts)


def _outcome(after: StandardPidState, output: float) -> tuple[StandardPidState, float, float, int]:
    """Return the state, an output as power, the output, and the flags as bits."""
    bits = int(output > 100.0) + 2 * int(output < 0.0) + 4 * int(not math.isfinite(output))
    power = min(max(output, 0.0), 100.0) if output >= 0.0 else 0.0  # what is no number puts no switch on
    return after, power, output, bits


def from_text(text: str, _sample_time_s: float | None, source: str) -> ReadBack:
    """Return the words in a text, and the inputs of the block that are none.

    Raises:
        InputError: as `words_in`; the text has limits, so it is the repaired block's, whose KP has the other sign.
    """
    read = words_in(text, source, ExpectedBlock(FIELDS, UNITS))
    limits = [each for each in read.passed_over if each.upper().startswith(("XMIN ", "XMAX "))]
    if limits:
        raise InputError(f"{source}: {limits[0]}: the standard's block has no limits; these are words of iec-pid")
    return read


TEXT: Final = "iec_pid_text.st"


def entries(words: Words, _setpoint_degC: float | None, _units: object) -> dict[str, EntryChange]:
    """Return each word as the exported files have it, see `heatertune.plc.keyed_entry.KeyedEntry`."""
    return entry_texts(dict(constants(words, FIELDS)))


def export_words(words: Words, certificate: Certificate) -> dict[str, str]:
    """Return the program; the same words and certificate give the same bytes."""
    clock = clock_for(words, certificate.actuator)
    head = head_of("heater controller: calls the library's PID of IEC 61131-3; for comparison, not into service",
                   words, words.whole["CYCLE"], certificate, clock)
    lines = [*head, *(f"fault: {fault}" for fault in faults(words))]
    listed = variables(words, clock, proven_setpoint(words, certificate, COUNTS))
    limits = ProgramLimits(most=100.0, cools=words.values["KP"] > 0.0)
    wires = [("AUTO", "HeaterOn AND NOT ByHand"), ("PV", "HeaterTemperature"), ("SP", "HeaterSetPoint"),
             ("X0", "HandPower"), *constants(words, FIELDS)]
    call = f"{instance_call('HeaterPid', wires)}HeaterPower := HeaterPid.XOUT;\n"
    text = program("Heater", {"HeaterPid": "PID"}, listed, statements(words, clock, call, limits))
    return {TEXT: comment(*lines) + text}


class StandardPid(Controller, name="iec-pid-text"):
    """The PID of the IEC 61131-3 text with its faults; the power is XOUT as far as it is within 0…100 %."""

    title = "IEC 61131-3 PID as printed (matiec in Beremiz and OpenPLC, lib/pid_st.txt)"
    main_file = "iec_pid_text.st"
    setpoint_entry = staticmethod(setpoint_entry)
    can = ("what the standard's text computes, for comparison; exported as a call of the library's block",)
    cannot = (
        "no limits, no anti-windup, no P or PD: TR = 0 divides by zero",
        "KP has to be negative for a heater, and by hand the output is KP*X0",
        "one unit of time in the I and D part for seconds alone (`--assume time_unit=s`: matiec)",
        "no setpoint ramp and no boost",
    )
    fields, assumptions, timer, counts = FIELDS, StandardPidAssumptions, TIMER, COUNTS
    inputs: ClassVar = {"SP": "REAL", "PV": "REAL", "X0": "REAL", "AUTO": "BOOL"}
    keyed_entries = staticmethod(entries)
    tick_s = HALF_WAVE_S
    core = StepFunctions(step=step, measure=measure, flags=("above 100 %", "below 0 %", "overflow"), singles=True)
    values, design, interval_s = staticmethod(values_of), staticmethod(design_of), staticmethod(interval_s)
    export, scan_all, faults = staticmethod(export_words), staticmethod(scan), staticmethod(faults)
    text = staticmethod(from_text)

    def begin(self, words: Words, assume: StandardPidAssumptions) -> ControllerState:
        """Return the state before the first call."""
        return ControllerState((block_of(words.values, assume), assume), COLD)
