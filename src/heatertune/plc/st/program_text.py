"""The program around a block in structured text: calls each Ts, enabling, boost, setpoint ramp, PWM; and its header.

It runs in each scan and sums the scan times. While the heater is off or boosts, the block is disabled, and the program
sets the power to 0 or to the block's maximum. Also the values of TIME_TO_REAL, whose unit the standard leaves to the
implementation.
"""

from __future__ import annotations

from collections.abc import Iterable, Iterator, Mapping, Sequence
from decimal import Decimal
from typing import Final, NamedTuple

from heatertune.plc.core import Sensor, count
from heatertune.plc.cpu.statement_translation import in_ascii
from heatertune.plc.open_points import OpenPoint
from heatertune.plc.print.statements import CELLS, renamed, setpoint_ramp
from heatertune.plc.pwm import Actuator, pulse_ends
from heatertune.plc.ramp import Ramp
from heatertune.plc.single_precision import real_of, single, word_of
from heatertune.plc.words import Certificate, Words

__all__ = [
    "LARGEST", "MILLISECONDS", "NANOSECONDS", "SECONDS", "TENS_OF_MS", "TIME_UNIT", "BlockSource", "ProgramClock",
    "ProgramLimits", "Variable", "by_hand", "clock_for", "comment", "enable_condition", "entered_setpoint",
    "function_block", "head_of", "instance_call", "literal", "program", "proven_setpoint", "statements", "time_to_real",
    "variables",
]


SECONDS: Final = 0
MILLISECONDS: Final = 1
TENS_OF_MS: Final = 2
NANOSECONDS: Final = 3

TIME_UNIT: Final = OpenPoint(
    name="time_unit",
    means={"s": SECONDS, "ms": MILLISECONDS, "ten_ms": TENS_OF_MS, "ns": NANOSECONDS},
    reason="unit of TIME_TO_REAL: s (matiec: Beremiz, OpenPLC), ms (CODESYS), whole tens of ms (FPWIN Pro), ns",
)


def time_to_real(duration_ms: int, unit: int) -> float:
    """Return the REAL of a duration of whole milliseconds in a unit, one of those above.

    matiec adds whole seconds and their fraction in double precision first (lib/C/iec_std_functions.h).
    """
    if unit == MILLISECONDS:
        return single(duration_ms)
    if unit == TENS_OF_MS:
        return single(duration_ms // 10)
    if unit == NANOSECONDS:
        return single(duration_ms * 1_000_000)
    return single(duration_ms // 1000 + (duration_ms % 1000) * 1_000_000 / 1_000_000_000)


#: the largest REAL
LARGEST: Final = "3.4028235E38"


class BlockSource(NamedTuple):
    """A block.

    Attributes:
        name: its type.
        declarations: section → (name, type, initial value, meaning).
        body: its statements.
    """

    name: str
    declarations: Mapping[str, tuple[tuple[str, str, str, str], ...]]
    body: str


def comment(*lines: str) -> str:
    """Return comments, one a line: in ASCII, and without the two signs that begin and end a comment."""
    plain = (in_ascii(line).replace("(*", "( *").replace("*)", "* )") for line in lines)
    return "".join(f"(* {line} *)\n" for line in plain)


def function_block(block: BlockSource) -> str:
    """Return the whole declaration, one line per variable."""
    lines = [f"FUNCTION_BLOCK {block.name}"]
    for section, variables in block.declarations.items():
        lines += [section, *[_declared(*variable) for variable in variables], "END_VAR"]
    return "\n".join(lines) + f"\n\n{block.body}\nEND_FUNCTION_BLOCK\n"


def _declared(name: str, type_: str, initial: str, meaning: str) -> str:
    value = f" := {initial}" if initial else ""
    return f"  {name} : {type_}{value}; (* {meaning} *)"


Variable = tuple[str, str, str, str]

#: numbers in this range are written without an exponent
_LOWEST_PLAIN: Final = 1e-4
_PLAIN: Final = 1e6

#: ticks of a period whose product with a power fits into 32 bits
_MOST_TICKS: Final = 77000
#: parts of a percent, these times 100, and the same in parts of 12 bits: so all products fit into 32 bits
_PARTS: Final = 65536
_FULL: Final = 100 * _PARTS
_LOW: Final = 4096

#: variables of the program; the names are free
_VARIABLES: Final = (
    ("HeaterOn", "BOOL", "FALSE", "enables the controller; FALSE: heater off"),
    ("ByHand", "BOOL", "FALSE", "TRUE: HandPower is the output"),
    ("HandPower", "REAL", "0.0", "output by hand, %"),
    ("HeaterSetPoint", "REAL", "{setpoint}", "degC"),
    ("HeaterTemperature", "REAL", "0.0", "degC, from the input module"),
    ("HeaterPower", "REAL", "0.0", "%"),
    ("ScanMs", "DINT", "{tick}", "time of one scan, ms"),
    ("HeaterSince", "DINT", "0", "ms since the last call of the controller"),
    ("HeaterDue", "BOOL", "FALSE", "a call is due"),
    ("HeaterWasOn", "BOOL", "FALSE", "HeaterOn of the scan before"),
)
#: scans in Ts at least, where there is no PWM: a block that keeps Ts itself has to be called more often
_SCANS: Final = 4
_PWM_VARIABLES: Final = (
    ("HeaterOutput", "BOOL", "FALSE", "the heater's switch"),
    ("HeaterPhase", "DINT", "0", "ms since the period began"),
    ("HeaterOnMs", "DINT", "0", "of this period"),
    ("HeaterShare", "REAL", "0.0", "HeaterPower in parts"),
    ("HeaterWhole", "DINT", "0", "the same, cut"),
    ("HeaterRest", "DINT", "0", "what was cut off, times the steps of a period"),
    ("HeaterHigh", "DINT", "0", "of the product with the steps of a period"),
)
#: cells of the setpoint ramp → variables of the program
_RAMP_NAMES: Final = {"Asked": "HeaterSetPoint", "Reading": "HeaterTemperature", "Lead": "HeaterRamp"} | {
    name: f"HeaterRamp{name}" for name in CELLS}
_BOOST_VARIABLES: Final = (
    ("HeaterBoost", "BOOL", "FALSE", "full power, the controller not enabled"),
    ("HeaterAway", "REAL", "0.0", "degC, from the temperature to the setpoint"),
)


class ProgramClock(NamedTuple):
    """The scans of the program, and the PWM that it makes of them.

    Attributes:
        tick_ms: time of a scan, or the longest that makes the pulses as they were proven [ms].
        steps: of the PWM's period, a tick each; 0: there is no PWM in the program.
        least, most: smallest power with a pulse, and largest one with a pause [%].
        why: why there is no PWM; empty where there is one.
    """

    tick_ms: int
    steps: int = 0
    least: float = 0.0
    most: float = 0.0
    reason: str = ""


def clock_for(words: Words, actuator: Actuator | None) -> ProgramClock:
    """Return the clock of a program that switches as was proven; None: no switch is known."""
    def none(why: str) -> ProgramClock:
        ts = _ms(words)
        return ProgramClock(next((ts // scans for scans in range(_SCANS, ts + 1) if ts % scans == 0), ts), reason=why)

    if actuator is None:
        return none("no switch is known of the proof")
    ticks, tick = actuator.ticks(words.sample_time_s), 1000.0 * actuator.resolution_s
    if ticks is None or min(ticks) < 1 or ticks.per_period > _MOST_TICKS or abs(tick - round(tick)) > 1e-6:
        return none("its times are no whole steps of milliseconds")
    if actuator.minimum_rule != "drop":
        return none("its rule makes up what is left out")
    least, most = pulse_ends(actuator, real_of, word_of(100.0))
    return ProgramClock(round(tick), ticks.per_period, real_of(least), real_of(most))


class ProgramLimits(NamedTuple):
    """What the program has to know of the block's words.

    Attributes:
        most: its output is never above [%].
        cools: whether the output rises where the temperature is too high.
    """

    most: float
    cools: bool


def variables(
    words: Words, clock: ProgramClock, setpoint_degC: float, own: tuple[Variable, ...] = ()
) -> tuple[Variable, ...]:
    """Return name, type, initial value and meaning of the program's variables.

    Args:
        words: that are exported.
        clock: of the program.
        setpoint_degC: as it was proven, on the counts of the input module [°C].
        own: more of them, for this target alone.
    """
    ramp = () if words.ramp is None else tuple(_ramp_variables(words.ramp))
    boost = () if words.boost is None else _BOOST_VARIABLES
    start_values = {"setpoint": literal(single(setpoint_degC)), "tick": clock.tick_ms}
    base = tuple((name, type_, initial.format(**start_values), meaning) for name, type_, initial, meaning in _VARIABLES)
    return base + own + (_PWM_VARIABLES if clock.steps else ()) + boost + ramp


def _ramp_variables(ramp: Ramp) -> Iterator[Variable]:
    yield "HeaterRamp", "REAL", "0.0", "degC, the setpoint on its ramp"
    text = "".join(group.lines for group in setpoint_ramp(ramp))
    for name, meaning in CELLS.items():
        if f"{name} :=" in text:
            kind = ("INT", "0", meaning) if name == "Calls" else ("REAL", "0.0", f"degC, {meaning}")
            yield _RAMP_NAMES[name], *kind


def statements(
    words: Words, clock: ProgramClock, call: str, limits: ProgramLimits, *, before: str = "", or_when: str = ""
) -> str:
    """Return the program's statements.

    Args:
        words: that are exported.
        clock: of the program.
        call: statements that call the block and take its output to HeaterPower.
        limits: of the block.
        before: statements of the target's own before all others.
        or_when: condition under which the block is called though it is not due; empty: never.
    """
    ts = _ms(words)
    ramp = "" if words.ramp is None else f"IF HeaterDue THEN\n{_indented(_ramp(words.ramp))}END_IF;\n"
    boost, boosts = _boost(words, limits)
    return (
        f"{before}"
        "(* a call each Ts, the first one at once; a scan that is too long is not made up *)\n"
        "IF HeaterOn AND HeaterWasOn THEN\n  HeaterSince := HeaterSince + ScanMs;\n"
        f"ELSE\n  HeaterSince := {ts};\nEND_IF;\n"
        f"HeaterDue := HeaterOn AND HeaterSince >= {ts};\n"
        f"IF HeaterDue THEN\n  HeaterSince := HeaterSince MOD {ts};\nEND_IF;\n"
        f"{ramp}{boost}"
        f"IF HeaterDue OR {f'{or_when} OR ' if or_when else ''}NOT HeaterOn THEN\n"
        f"{_indented(call + boosts)}END_IF;\n"
        "IF NOT HeaterOn THEN (* the block leaves its output as it was *)\n  HeaterPower := 0.0;\nEND_IF;\n"
        f"{_pwm(clock)}HeaterWasOn := HeaterOn;\n"
    )


def instance_call(instance: str, wires: Iterable[tuple[str, str]]) -> str:
    """Return the call of an instance with its inputs, one a line."""
    return f"{instance}(\n" + ",\n".join(f"  {name} := {value}" for name, value in wires) + ");\n"


def program(name: str, instances: Mapping[str, str], listed: Iterable[Variable], body: str) -> str:
    """Return a whole program: its variables, its instances (name → block), its statements."""
    declared = "".join(f"  {n} : {t} := {v}; (* {meaning} *)\n" for n, t, v, meaning in listed)
    declared += "".join(f"  {instance} : {block};\n" for instance, block in instances.items())
    return f"PROGRAM {name}\nVAR\n{declared}END_VAR\n\n{body}\nEND_PROGRAM\n"


def proven_setpoint(words: Words, certificate: Certificate, counts: int) -> float:
    """Return the setpoint as the proof had it: a count of the input module, in °C."""
    s = words.scaling
    proven = s.low_degC if certificate.setpoint_degC is None else certificate.setpoint_degC
    return single(s.low_degC + s.span_degC * count(Sensor(s.low_degC, s.span_degC, counts), proven) / counts)


def entered_setpoint(counts: int, words: Words, setpoint_degC: float, _units: int) -> str:
    """Return the setpoint of a proof [°C] as a person enters it into the program."""
    proven = proven_setpoint(words, Certificate(verdict="", setpoint_degC=setpoint_degC), counts)
    return f"HeaterSetPoint = {literal(proven)} °C"


def _ms(words: Words) -> int:
    return round(1000.0 * words.sample_time_s)


def literal(value: float) -> str:
    """Return the shortest decimal that is this single, as the language writes a REAL."""
    digits = next(n for n in range(1, 10) if single(float(f"{value:.{n}g}")) == value)
    shortest = f"{value:.{digits}g}"
    if _LOWEST_PLAIN <= abs(value) < _PLAIN or value == 0.0:
        plain = f"{Decimal(shortest):f}"
        return plain if "." in plain else f"{plain}.0"
    mantissa, _, exponent = f"{value:.{digits - 1}e}".partition("e")
    return f"{mantissa}{'' if '.' in mantissa else '.0'}E{int(exponent)}"


def _indented(lines: str) -> str:
    return "".join(f"  {line}\n" for line in lines.splitlines())


def _pwm(clock: ProgramClock) -> str:
    """Return the statements of the PWM: whole ticks, the nearest number of them, halves up, nothing carried over."""
    if not clock.steps:
        return ""
    period = clock.steps * clock.tick_ms
    return (
        "IF HeaterOn AND HeaterWasOn THEN\n  HeaterPhase := HeaterPhase + ScanMs;\n"
        f"ELSE\n  HeaterPhase := {period};\nEND_IF;\n"
        f"IF HeaterPhase >= {period} THEN (* a period begins *)\n  HeaterPhase := HeaterPhase MOD {period};\n"
        f"  IF NOT (HeaterPower >= {literal(clock.least)}) THEN\n    HeaterOnMs := 0;\n"
        f"  ELSIF HeaterPower > {literal(clock.most)} THEN\n    HeaterOnMs := {period};\n"
        "  ELSE\n"
        f"    HeaterShare := HeaterPower * {_PARTS}.0;\n    HeaterWhole := TRUNC(HeaterShare);\n"
        f"    HeaterRest := TRUNC((HeaterShare - DINT_TO_REAL(HeaterWhole)) * {clock.steps}.0);\n"
        f"    HeaterHigh := (HeaterWhole / {_LOW}) * {clock.steps};\n"
        f"    HeaterRest := HeaterRest + (HeaterHigh MOD {_FULL // _LOW}) * {_LOW}\n"
        f"      + (HeaterWhole MOD {_LOW}) * {clock.steps} + {_FULL // 2};\n"
        f"    HeaterOnMs := (HeaterHigh / {_FULL // _LOW} + HeaterRest / {_FULL}) * {clock.tick_ms};\n"
        "  END_IF;\nEND_IF;\n"
        "HeaterOutput := HeaterOn AND HeaterPhase < HeaterOnMs;\n"
    )


def enable_condition(words: Words) -> str:
    """Return when the controller is enabled."""
    return "HeaterOn" if words.boost is None else "HeaterOn AND NOT HeaterBoost"


def _boost(words: Words, limits: ProgramLimits) -> tuple[str, str]:
    """Return the statements that find out whether to boost, and those that do; what is no number is not far."""
    boost = words.boost
    if boost is None:
        return "", ""
    away = "HeaterTemperature - HeaterSetPoint" if limits.cools else "HeaterSetPoint - HeaterTemperature"
    return (
        "(* far from the setpoint: full power, and the controller not enabled *)\n"
        f"IF HeaterDue THEN\n  HeaterAway := {away};\n"
        f"  HeaterBoost := (HeaterAway > {literal(boost.again_degC)}\n"
        f"      OR (HeaterBoost OR NOT HeaterWasOn) AND HeaterAway > {literal(boost.within_degC)})\n"
        f"    AND HeaterAway <= {LARGEST} AND NOT ByHand;\nEND_IF;\n",
        f"IF HeaterBoost THEN\n  HeaterPower := {literal(limits.most)};\nEND_IF;\n",
    )


def _ramp(ramp: Ramp) -> str:
    """Return the statements that lead the setpoint; it begins at the reading of the call that enables the block."""
    groups = renamed(setpoint_ramp(ramp, literal), _RAMP_NAMES)
    moves = "".join(f"(* {group.title} *)\n{group.lines}" for group in groups)
    return ("IF NOT HeaterWasOn THEN\n  HeaterRamp := HeaterTemperature;\n"
            f"{f'  HeaterRampCalls := {ramp.calls};{chr(10)}' if ramp.calls > 1 else ''}END_IF;\n{moves}")


def head_of(
    title: str, words: Words, interval_ms: int, certificate: Certificate, clock: ProgramClock, *,
    tool: str = "a vendor's tool",
) -> tuple[str, ...]:
    """Return the head of an exported text.

    Args:
        title: what it is.
        words: that it holds.
        interval_ms: at which the block is called [ms].
        certificate: of their proof.
        clock: of the program.
        tool: in which it was not tried.
    """
    scale = words.scaling
    pwm = f"no PWM in the program: {clock.reason}"
    if clock.steps:
        pwm = f"PWM in the program, steps of {clock.tick_ms} ms"
    return (
        title,
        f"sensor {scale.low_degC:g}...{scale.high_degC:g} degC; TA: called every {interval_ms} ms; output in percent; "
        f"{pwm}",
        *certificate.head,
        f"not tried in {tool}",
    )


def by_hand(
    clock: ProgramClock, certificate: Certificate, *, of_clock: Sequence[str] = (), of_start: Sequence[str] = ()
) -> list[str]:
    """Return the remaining manual steps, numbered.

    Args:
        clock: of the program.
        certificate: of the proof.
        of_clock: what a block adds to the steps of the clock.
        of_start: to those of the start-up.
    """
    wired = "HeaterOutput" if clock.steps else "HeaterPower, through a PWM of yours as it was proven,"
    exact = f"; a scan longer than {clock.tick_ms} ms makes coarser pulses than were proven" if clock.steps else ""
    loaded = "the lowest" if certificate.setpoint_degC is None else "as proven"
    steps = (
        f"wire HeaterOn and HeaterTemperature (degC) to your inputs and {wired} to the heater's switch; HeaterOn must "
        "fall when the sensor breaks: that puts the heater off",
        f"ScanMs is the time of one scan: call the program from a task of {clock.tick_ms} ms, or write the time of the "
        f"last scan there each scan{exact}",
        *of_clock,
        "leave the variables and the block without retention: each start-up is from cold then, as proven",
        *of_start,
        f"setpoint: HeaterSetPoint begins {loaded}; another one is not proven",
    )
    return ["remains to be done by hand:", *(f"  {number}. {step}" for number, step in enumerate(steps, start=1))]
