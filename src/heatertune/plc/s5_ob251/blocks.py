"""The blocks around OB251, statement by statement: FB30 in OB13, FB31 in OB21 and OB22, FB33 for a setpoint ramp.

All state is stored in DB31: OB1 uses the flags, too, and those from 200 on are scratch of the standard function
blocks. The PWM behind YA is a staircase of 16-bit sums over the ticks of a period, because STEP 5 has no
multiplication.

Operations have their English names (S5-100U manual EWA 4NEB 812 6120, chapter 8; TB tests a bit). A comparison is
ACCU 2 … ACCU 1 and leaves both unchanged.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from math import ceil
from typing import Final, NamedTuple

from heatertune.plc.inputs import BROKEN_MA, FOUR_TO_TWENTY
from heatertune.plc.print.statements import CELLS, pulse_staircase, renamed, setpoint_ramp
from heatertune.plc.print.stl import S5Printer
from heatertune.plc.pwm import INSTANT_S, Actuator, Ticks, pulse_ends
from heatertune.plc.ramp import Ramp
from heatertune.plc.s5_ob251.step import FULL_SCALE, percent
from heatertune.plc.words import Certificate, Words

__all__ = [
    "ANALOG", "DB", "FOUR_MA", "HEAT", "INPUT", "MODE", "OUTPUT", "PERIOD_ENDS", "RAMP", "START", "WORK", "Staircase",
    "heat", "organisation_blocks", "program_listing", "ramp_block", "retains", "staircase", "start_up", "work",
]


_MOST: Final = 32767
#: a staircase above full power: the next tick begins a period
PERIOD_ENDS: Final = FULL_SCALE + 1


class Staircase(NamedTuple):
    """How OB13 makes the PWM.

    Attributes:
        ticks: calls of OB13 from one call of OB251 to the next, and in a period of the PWM.
        least, most: smallest YA with a pulse, and largest one with a pause.
    """

    ticks: Ticks
    least: int
    most: int


def staircase(actuator: Actuator | None, sample_time_s: float) -> Staircase | None:
    """Return the staircase of a switch; None: no clock of OB13 makes it, its sums overflow, or it carries over.

    Args:
        actuator: the switch that was proven; None: none is known.
        sample_time_s: TA [s].
    """
    ticks = None if actuator is None else actuator.ticks(sample_time_s)
    if actuator is None or ticks is None or actuator.minimum_rule == "carry":
        return None
    if ticks.per_call > _MOST or 4 * ticks.per_period > _MOST or not _of_ten_ms(actuator.resolution_s):
        return None
    return Staircase(ticks, *pulse_ends(actuator, percent, FULL_SCALE))


def _of_ten_ms(tick_s: float) -> bool:
    """Return whether OB13 keeps an interval: its system data counts 10 ms."""
    counts = 100.0 * tick_s
    return round(counts) > 0 and abs(round(counts) - counts) <= INSTANT_S


#: numbers of the data blocks: OB251's, and the program's
DB: Final = 30
WORK: Final = 31
#: numbers of the function blocks; FB32 is that of the feed-forward
HEAT: Final = 30
START: Final = 31
RAMP: Final = 33
#: analog input, switch for automatic, byte of outputs with the heater at bit 0, analog output
INPUT: Final = "PW 128"
MODE: Final = "I 0.0"
OUTPUT: Final = "PY 4"
ANALOG: Final = "PW 176"

#: words of DB31 with which FB30 makes the PWM
_PWM_WORDS: Final = {"YA": 4, "STAIR": 6, "REST": 7, "HELD": 8}
#: words of DB31 with which FB33 leads W along its ramp
_RAMP_WORDS: Final = {"ASKED": 0, "X": 1, "W": 2, "CALLS": 11, "END": 12, "AHEAD": 13, "BACK": 14, "SIZE": 15}
_WIDTH: Final = 22

#: of the input's word, below its value
_STATUS: Final = 3
#: units of 4 mA, and of 3.6 mA and more, where 20 mA are 2560 (S5-135U/155U manual C79000-G8576-C199-06, p. 9-71)
FOUR_MA: Final = 512
_BROKEN_UNITS: Final = ceil(FOUR_MA * BROKEN_MA / 4.0)


def work(setpoint: int, ramp: Ramp | None) -> list[tuple[int, str]]:
    """Return the words of DB31 from DW0 on, each with what it is; beside the setpoint they are as FB31 leaves them.

    Args:
        setpoint: setpoint [units].
        ramp: of the setpoint; None: none.
    """
    words = [
        (setpoint, "ASKED: the setpoint, 0...2047 units: yours to write"), (0, "X"), (0, "W"),
        (0, "analog input as read; bit 1: wire break"), (0, "YA"), (1, "calls of OB13 until OB251's"),
        (PERIOD_ENDS, "STAIR of the PWM"), (0, "REST of the PWM"), (0, "HELD of the PWM: YA of this period"),
        (0, "1: the sensor broke, off until manual"), (0, "1: the ramp has begun"),
        *((0, f"{name} of the ramp: {CELLS[name.capitalize()]}") for name in list(_RAMP_WORDS)[3:])]
    return words if ramp is not None else words[:10]


def heat(stairs: Staircase | None, ramp: Ramp | None, input_: str | None = None) -> list[str]:
    """Return FB30, called by OB13: it reads X, leads W, calls OB251 when that is due, and switches the heater.

    Args:
        stairs: of the PWM; None: an analog output.
        ramp: of the setpoint; None: none.
        input_: range of the analog module, see `heatertune.plc.inputs`.
    """
    per_call = 1 if stairs is None else stairs.ticks.per_call
    output = _columns(_ANALOG) if stairs is None else _pwm(stairs)
    body = "".join((_read(per_call, input_), _BROKEN_BEFORE, _mode(ramp), _CONTROL, _BROKEN))
    return [f"FB {HEAT}", "NAME :HEAT", *_columns(body), *output, *_columns("BE")]


def ramp_block(ramp: Ramp) -> list[str]:
    """Return FB33, called by FB30 where W follows a ramp; its caller has opened DB31."""
    printer, moves = S5Printer(_RAMP_WORDS), renamed(setpoint_ramp(ramp), {"Reading": "X", "Lead": "W"})
    return [f"FB {RAMP}", "NAME :RAMP", *printer.print_groups(moves), printer.next("BE")]


def start_up(interval_s: float, *, pwm: bool, ramp: Ramp | None, retained: bool) -> list[str]:
    """Return FB31, called by OB21 and OB22: clock, PWM and ramp begin anew whatever the RAM has kept.

    Args:
        interval_s: of OB13 [s].
        pwm: whether the heater has a switch, not an analog output.
        ramp: of the setpoint; None: none.
        retained: whether OB251 goes on with what it kept, and a sensor that broke stays off; else both begin anew.
    """
    ramp_start = "" if ramp is None else "T  DW 10\n"
    anew = f"C  DB {DB}\n" + ("RU D 11.2; whatever was under way\n" if retained else _CLEARED)
    body = f"""{anew}C  DB {WORK}
L  KF +1; the first call of OB13 calls OB251
T  DW 5
L  KF +{PERIOD_ENDS}; and begins a period of the PWM
T  DW 6
L  KF +0
T  DW 4
T  DW 7
T  DW 8
{"" if retained else f"T  DW 9{chr(10)}"}{ramp_start}T  {OUTPUT if pwm else ANALOG}; heater off
L  KF +{round(100.0 * interval_s)}; interval of OB13, in 10 ms
T  RS 97
BE
"""
    return [f"FB {START}", "NAME :START", *_columns(body)]


def organisation_blocks() -> list[list[str]]:
    """Return the organisation blocks: cycle, time, start-up by hand and by the supply."""
    calls = {1: "", 13: f"JU FB {HEAT}\nNAME :HEAT\n", 21: f"JU FB {START}\nNAME :START\n",
             22: f"JU FB {START}\nNAME :START\n"}
    return [[f"OB {number}", *_columns(f"{body}BE")] for number, body in calls.items()]


def _read(per_call: int, input_: str | None) -> str:
    """Return what leaves a sensor that breaks at once, OB251 when it is not due, and X else."""
    current = input_ == FOUR_TO_TWENTY
    broken = f"""L  DW 3; below 3.6 mA the wire is broken, too
L  KF +{_BROKEN_UNITS << _STATUS}
<F
JC =BROK
""" if current else ""
    low = f"""L  DW 3
SRW {_STATUS}
L  KF +{FOUR_MA}; 4 mA: X 0 below it
-F
L  KF +0
<F
JC =READ
TAK
""" if current else f"""L  DW 3; X: 0 below the range
L  KF +0
<F
JC =READ
L  DW 3
SRW {_STATUS}
"""
    return f"""C  DB {WORK}
L  {INPUT}; value from bit {_STATUS} on, bit 1: wire break
T  DW 3
TB D 3.1
JC =BROK
{broken}L  DW 5; OB251 {"now" if per_call == 1 else f"in every {per_call}th call"}
L  KF +1
-F
T  DW 5
L  KF +0
>F
JC =OUT
L  KF +{per_call}
T  DW 5
{low}L  KF +{FULL_SCALE}; {FULL_SCALE} at its end and above
>F
JC =READ
TAK
READ:T  DW 1
"""


#: with DB30 open
_CLEARED: Final = """SU D 11.2; OB251 off: it clears DW18 to DW48
JU OB 251
RU D 11.2
"""

#: a sensor that broke is not trusted again before someone asks for manual; OB251 then begins anew
_BROKEN_BEFORE: Final = f"""L  DW 9; did the sensor break before?
L  KF +0
!=F
JC =MODE
C  DB {DB}
SU D 11.2; then OB251 begins anew
JU OB 251
RU D 11.2
C  DB {WORK}
A  {MODE}
JC =OUT
L  KF +0; once manual is asked for
T  DW 9
"""


def _mode(ramp: Ramp | None) -> str:
    """Return what sets bit 0 of STEU and W: at X in manual, as asked for or as led in automatic."""
    automatic = f"""AUTO:L  DW 10; the ramp begins at X
L  KF +0
><F
JC =RAMP
L  DW 1
T  DW 2
L  KF +1
T  DW 10
L  KF +{ramp.calls}
T  DW 11
RAMP:JU FB {RAMP}
NAME :RAMP
""" if ramp is not None else """AUTO:L  DW 0; W as asked for
T  DW 2
"""
    anew = "" if ramp is None else "L  KF +0\nT  DW 10\n"
    return f"""MODE:A  {MODE}
JC =AUTO
L  DW 1; manual: W follows X
T  DW 2
{anew}C  DB {DB}
RU D 11.0
JU =CALL
{automatic}C  DB {DB}
SU D 11.0
"""


_CONTROL: Final = f"""CALL:C  DB {WORK}
L  DW 1
L  DW 2
C  DB {DB}
T  DW 9; W
TAK
T  DW 22; X
JU OB 251
L  DW 48; YA
C  DB {WORK}
T  DW 4
"""

#: off in this very call, and no call of OB251 before the sensor is back
_BROKEN: Final = f"""JU =OUT
BROK:L  KF +1; the sensor broke: off at once
T  DW 9
L  KF +{PERIOD_ENDS}
T  DW 6
L  KF +0
T  DW 4
"""

_ANALOG: Final = f"""OUT:L  DW 4; 2047 units are 16376; 16384 is the end of the module's range
SLW 3
T  {ANALOG}
"""


def _pwm(stairs: Staircase) -> Iterator[str]:
    """Yield the staircase and the switch; YA is taken over where a period begins, after OB251 where both are due."""
    printer = S5Printer(_PWM_WORDS)
    printer.mark("OUT")
    pulses = pulse_staircase(stairs.ticks.per_period, FULL_SCALE, stairs.least, stairs.most)
    yield from printer.print_groups(renamed(pulses, {"Power": "YA"}))
    yield printer.next("L", printer.operand("HELD"), "on while STAIR is not above HELD")
    for statement in (("L", printer.operand("STAIR")), (">=F",), ("JC", "=ON"), ("L", "KB 0"), ("JU", "=SET")):
        yield printer.next(*statement)
    yield printer.line("ON", "L", "KB 1")
    yield printer.line("SET", "T", OUTPUT)


def _columns(body: str) -> Iterator[str]:
    """Return statements in columns: label, colon, operation, semicolon, comment."""
    for line in body.splitlines():
        statement, _, comment = line.partition(";")
        if statement.startswith("NAME"):
            yield statement
            continue
        label, _, operation = statement.rpartition(":")
        yield f"{label:5s}:{f'{operation.ljust(_WIDTH)};{comment}' if comment else operation}"


#: of OB13 where nobody writes SD97 [s]
_USUAL_S: Final = 0.1
#: that a call of FB30 takes, OB251 aside: some forty statements on a CPU 941 [ms]
_CALL_MS: Final = 2.0


def program_listing(words: Words, certificate: Certificate, setpoint: int, typed: Sequence[str]) -> str:
    """Return the listing.

    Args:
        words: that were proven.
        certificate: of the proof.
        setpoint: setpoint [units].
        typed: lines of DB30.
    """
    stairs = staircase(certificate.actuator, words.sample_time_s)
    interval = words.sample_time_s if stairs is None else words.sample_time_s / stairs.ticks.per_call
    by_hand = _by_hand(words, certificate, stairs, interval)
    head = [
        "Whole program around OB251 for SIMATIC S5-115U: a listing to key in, remarks behind ;",
        *_conditions(words, stairs, interval), _start_up(certificate), *certificate.head,
        "to do by hand:", *(f"{number}. {what}" for number, what in enumerate(by_hand, 1)),
    ]
    ramp = words.ramp
    scale = words.scaling
    started = start_up(interval, pwm=stairs is not None, ramp=ramp, retained=retains(certificate))
    blocks = [
        [f"DB{DB}", *typed], [f"DB{WORK}", *_work(setpoint, words)], heat(stairs, ramp, scale.input), started,
        *([] if ramp is None else [ramp_block(ramp)]), *organisation_blocks()]
    return "\n".join([*(f"// {line}" for line in head), *(line for block in blocks for line in ("", *block))]) + "\n"


def _conditions(words: Words, stairs: Staircase | None, interval_s: float) -> Iterator[str]:
    scale = words.scaling
    yield (f"sensor {scale.low_degC:g}...{scale.high_degC:g} °C = 0...{FULL_SCALE} units; "
           f"output 0...{FULL_SCALE} units = 0...100 % power")
    call_rate = "" if stairs is None or stairs.ticks.per_call == 1 else f" in every {stairs.ticks.per_call}th call"
    yield f"OB13 every {interval_s:g} s calls FB{HEAT}, which calls OB251{call_rate}: TA = {words.sample_time_s:g} s"
    if stairs is not None:
        yield f"PWM: {stairs.ticks.per_period} calls of OB13 a period, the nearest whole number of them on"
    if words.ramp is not None:
        yield f"W follows the setpoint asked for: {words.ramp}"


def retains(certificate: Certificate) -> bool:
    """Return whether OB251 goes on after a start-up with what it kept."""
    return certificate.switches.get("start_up") == "retained"


def _start_up(certificate: Certificate) -> str:
    if retains(certificate):
        return ("start-up: OB251 goes on with what DW18 to DW48 have kept, or from cold where they have kept nothing; "
                "the rest begins anew")
    return "start-up: OB21 and OB22 clear DW18 to DW48, whatever they have kept; the rest begins anew"


def _by_hand(words: Words, certificate: Certificate, stairs: Staircase | None, interval_s: float) -> Iterator[str]:
    """Return what no listing does."""
    scale, count = words.scaling, words.scaling.span_degC / FULL_SCALE
    module = (f"range card for 4 to 20 mA, {FOUR_MA} to 2560 units; below 3.6 mA the heater is off"
              if scale.input == FOUR_TO_TWENTY else
              "two's complement, 2048 units at the end of its range, wire-break detection on")
    yield (f"Wire or change: analog input {INPUT} ({module}), automatic {MODE}, "
           + (f"analog output {ANALOG}." if stairs is None else f"heater {OUTPUT.replace('PY', 'Q')}.0; {OUTPUT} is "
              "written as a whole: no other output in that byte."))
    yield (f"Range the sensor: {scale.low_degC:g} °C = 0 units, {scale.high_degC:g} °C = {FULL_SCALE} units, "
           f"{count:.3g} °C a unit.")
    yield (f"Setpoint: DW 0 of DB{WORK}, whole part of ({FULL_SCALE}/{scale.span_degC:g})*({scale.formula})"
           + (" - enter yours." if certificate.setpoint_degC is None else "; the proven one is in it."))
    yield (f"Your own OB1, OB13, OB21, OB22: add these statements to them. DB{DB}, DB{WORK}, FB{HEAT}, FB{START} and "
           "FB33 must be free.")
    if stairs is None:
        yield f"Power controller behind {ANALOG}; nothing here makes pulses. {_unmade(certificate)}"
    if interval_s < _USUAL_S:
        share = 0.1 * _CALL_MS / interval_s
        yield (f"OB13 every {1000.0 * interval_s:g} ms takes up to {share:.2g} % of a CPU 941's time, whose OB13 was "
               "made for 100 ms: see that the cycle of OB1 stays short.")
    yield (f"Try out with the heater disconnected: manual ({MODE} = 0) holds YH = DW 12 of DB{DB}; a broken sensor "
           f"switches off until {MODE} was 0.")
    if retains(certificate):
        yield (f"Backup battery: without one DB{DB} and DB{WORK} begin as they stand here, from cold and with this "
               "setpoint; start-up as chosen needs it.")
    yield "A limiter of its own that switches the heater off: no program stands for it."


def _unmade(certificate: Certificate) -> str:
    if certificate.actuator is None:
        return "Which switch was proven is not told."
    return f"It was proven as a switch: {certificate.actuator.summary}, which calls of OB13 do not make."


def _work(setpoint: int, words: Words) -> Iterator[str]:
    for dw, (value, comment) in enumerate(work(setpoint, words.ramp)):
        yield f"{f'{dw:4d}:  KF = {value:+06d};'.ljust(33)}{comment}"
