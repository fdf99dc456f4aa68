"""The blocks around OB251, statement by statement: FB30 in OB13, FB31 in OB21 and OB22, FB33 for a setpoint ramp.

All that they remember stands in DB31: flags are shared with OB1, and those from 200 on are scratch of the standard
function blocks. Operations have their English names (S5-100U manual EWA 4NEB 812 6120, chapter 8; TB tests a bit); a
comparison asks whether ACCU 2 … ACCU 1, and leaves both as they are.
"""

from __future__ import annotations

from collections.abc import Iterator
from math import ceil
from typing import Final

from heatertune.plc.inputs import BROKEN_MA, FOUR_TO_TWENTY
from heatertune.plc.ramp import Ramp
from heatertune.plc.s5_ob251.ramp import ramp_statements
from heatertune.plc.s5_ob251.staircase import Staircase
from heatertune.plc.s5_ob251.step import FULL_SCALE

__all__ = [
    "ANALOG",
    "DB",
    "FOUR_MA",
    "HEAT",
    "INPUT",
    "MODE",
    "OUTPUT",
    "RAMP",
    "START",
    "WORK",
    "heat",
    "organisation_blocks",
    "ramp_block",
    "start_up",
    "work",
]

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

_WORDS: Final = {"asked": "DW 0", "x": "DW 1", "w": "DW 2", "countdown": "DW 11", "lowest": "DW 12"}
_WIDTH: Final = 22

#: of the input's word, below its value
_STATUS: Final = 3
#: units of 4 mA, and of 3.6 mA and more, where 20 mA are 2560 (S5-135U/155U manual C79000-G8576-C199-06, p. 9-71)
FOUR_MA: Final = 512
_BROKEN_UNITS: Final = ceil(FOUR_MA * BROKEN_MA / 4.0)


def work(asked: int, ramp: Ramp | None) -> list[tuple[int, str]]:
    """Return the words of DB31 from DW0 on, each with what it is; beside the setpoint they are as FB31 leaves them.

    Args:
        asked: setpoint [units].
        ramp: of the setpoint; None: none.
    """
    words = [
        (asked, "setpoint asked for, 0...2047 units: yours to write"), (0, "X"), (0, "W"),
        (0, "analog input as read; bit 1: wire break"), (0, "YA"), (1, "calls of OB13 until OB251's"),
        (2047, "PWM: staircase"), (0, "PWM: its remainder"), (0, "PWM: YA of this period"),
        (0, "1: the sensor broke, off until manual"), (0, "1: the ramp has begun"),
        (0, "calls of OB251 until the ramp's next step"), (0, "how far W may go for X")]
    return words if ramp is not None else words[:10]


def heat(stairs: Staircase | None, ramp: Ramp | None, input_: str | None = None) -> list[str]:
    """Return FB30, called by OB13: it reads X, leads W, calls OB251 when that is due, and switches the heater.

    Args:
        stairs: of the PWM; None: an analog output.
        ramp: of the setpoint; None: none.
        input_: range of the analog module, see `heatertune.plc.inputs`.
    """
    per_call = 1 if stairs is None else stairs.ticks.per_call
    output = _ANALOG if stairs is None else _pwm(stairs)
    body = (_read(per_call, input_), _BROKEN_BEFORE, _mode(ramp), _CONTROL, _BROKEN, output, "BE")
    return [f"FB {HEAT}", "NAME :HEAT", *_columns("".join(body))]


def ramp_block(ramp: Ramp) -> list[str]:
    """Return FB33, called by FB30 where W follows a ramp."""
    return [f"FB {RAMP}", "NAME :RAMP", *_columns("\n".join(ramp_statements(ramp, _WORDS)))]


def start_up(interval_s: float, *, pwm: bool, ramp: Ramp | None, retained: bool) -> list[str]:
    """Return FB31, called by OB21 and OB22: clock, PWM and ramp begin anew whatever the RAM has kept.

    Args:
        interval_s: of OB13 [s].
        pwm: whether the heater has a switch, not an analog output.
        ramp: of the setpoint; None: none.
        retained: whether OB251 goes on with what it kept, and a sensor that broke stays off; else both begin anew.
    """
    begun = "" if ramp is None else "T  DW 10\n"
    anew = f"C  DB {DB}\n" + ("RU D 11.2; whatever was under way\n" if retained else _CLEARED)
    body = f"""{anew}C  DB {WORK}
L  KF +1; the first call of OB13 calls OB251
T  DW 5
L  KF +2047; and begins a period of the PWM
T  DW 6
L  KF +0
T  DW 4
T  DW 7
T  DW 8
{"" if retained else f"T  DW 9{chr(10)}"}{begun}T  {OUTPUT if pwm else ANALOG}; heater off
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
_BROKEN: Final = """JU =OUT
BROK:L  KF +1; the sensor broke: off at once
T  DW 9
L  KF +2047
T  DW 6
L  KF +0
T  DW 4
"""

_ANALOG: Final = f"""OUT:L  DW 4; 2047 units are 16376; 16384 is the end of the module's range
SLW 3
T  {ANALOG}
"""


def _pwm(stairs: Staircase) -> str:
    """Return the staircase and the switch; YA is taken over where a period begins, after OB251 where both are due."""
    return f"""OUT:L  DW 7; the staircase rises by {stairs.step} and {stairs.step_part}/{stairs.parts}
L  KF +{stairs.step_part}
+F
T  DW 7
L  DW 6
L  KF +{stairs.step}
+F
T  DW 6
L  DW 7
L  KF +{stairs.parts}
<F
JC =NEXT
-F
T  DW 7
L  DW 6
L  KF +1
+F
T  DW 6
NEXT:L  DW 6
L  KF +{FULL_SCALE}
<F
JC =LEVL
L  KF +{stairs.first}; a period begins
T  DW 6
L  KF +{stairs.first_part}
T  DW 7
{_taken_over(stairs)}LEVL:L  DW 6; on while the staircase is below YA
L  DW 8
<F
JC =ON
L  KB 0
JU =SET
ON:L  KB 1
SET:T  {OUTPUT}
"""


def _taken_over(stairs: Staircase) -> str:
    """Return what takes YA over, without pulses or pauses that are too short."""
    none = "" if stairs.least is None else f"""L  KF +{stairs.least}; a pulse that is too short is left out
<F
JC =NONE
L  DW 4
"""
    full = "" if stairs.full is None else f"""L  KF +{stairs.full}; a pause that is too short is, too
>=F
JC =FULL
L  DW 4
"""
    cut = "" if stairs.least is None else "NONE:L  KF +0\n"
    filled = "" if stairs.full is None else f"FULL:L  KF +{FULL_SCALE}\n"
    kept = "JU =KEEP\n".join(filter(None, ("L  DW 4\n" + none + full, cut, filled)))
    return f"{kept}{'KEEP:' if cut or filled else ''}T  DW 8\n"


def _columns(body: str) -> Iterator[str]:
    """Return statements in columns: label, colon, operation, semicolon, comment."""
    for line in body.splitlines():
        statement, _, comment = line.partition(";")
        if statement.startswith("NAME"):
            yield statement
            continue
        label, _, operation = statement.rpartition(":")
        yield f"{label:5s}:{f'{operation.ljust(_WIDTH)};{comment}' if comment else operation}"
