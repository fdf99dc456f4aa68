"""The monitor as a function block in structured text (IEC 61131-3), for controllers whose numbers are REAL."""

from __future__ import annotations

from typing import Final

from heatertune.plc.cpu.iec.machine import TextProgram
from heatertune.plc.cpu.iec.st_syntax import units
from heatertune.plc.print.statements import Group
from heatertune.plc.single_precision import single
from heatertune.plc.st.program_text import BlockSource, comment, function_block, literal
from heatertune.supervision.text.monitor_statements import INPUTS, OUTPUTS, Statements, alarm_text

__all__ = ["FILE", "StructuredText", "written"]

FILE: Final = "monitor.st"
_NAME: Final = "HT_MONITOR"
_INPUTS: Final = (
    ("Runs", "BOOL", "", "FALSE: heater off; it begins anew afterwards"),
    ("Acknowledge", "BOOL", "", "TRUE: the first alarm is forgotten"),
    ("Temperature", "REAL", "", "degC, as the controller reads it"),
    ("Output", "REAL", "", "of the controller, %"),
)
#: a program that calls the block, to run it here
_CALLER: Final = f"""
PROGRAM Caller
VAR
  Runs : BOOL; Acknowledge : BOOL; Temperature : REAL; Output : REAL; Alarm : DINT; Told : DINT; Power : DINT;
  Monitor : {_NAME};
END_VAR
Monitor(Runs := Runs, Acknowledge := Acknowledge, Temperature := Temperature, Output := Output);
Alarm := Monitor.Alarm; Told := Monitor.Told; Power := Monitor.Power;
END_PROGRAM
"""


def written(statements: Statements, head: list[str], *, low_degC: float, step_degC: float, highest: int) -> str:
    """Return the function block.

    Args:
        statements: of the monitor.
        head: remarks at its beginning.
        low_degC: temperature at the card's count 0 [°C].
        step_degC: of the card [°C].
        highest: its last count.
    """
    own = (*INPUTS.items(), *statements.cells.items())
    declarations = {
        "VAR_INPUT": _INPUTS,
        "VAR_OUTPUT": tuple((name, "DINT", "", meaning.replace("you write 0", "Acknowledge"))
                            for name, meaning in OUTPUTS.items()),
        "VAR": tuple((name, "DINT", "", meaning) for name, meaning in own),
    }
    body = (
        "IF Acknowledge THEN\n  Told := 0;\nEND_IF;\n"
        f"IF NOT Runs THEN\n  Begun := 0;\n  Alarm := 0;\nELSE\n{_indented(_read(low_degC, step_degC, highest))}"
        f"{''.join(map(_printed, statements.each_call))}"
        f"  IF In_Block >= {statements.block} THEN\n{_indented(''.join(map(_printed, statements.each_block)))}"
        "  END_IF;\nEND_IF;\n")
    return (comment(*head, *_by_hand()) + function_block(BlockSource(_NAME, declarations, body)))


def _by_hand() -> list[str]:
    return [
        "to do by hand:",
        f"  1. declare Monitor : {_NAME}; in the program of the heater, and call it behind the controller's block:",
        "     IF HeaterDue OR NOT HeaterOn THEN Monitor(Runs := HeaterOn, Acknowledge := your button,",
        "     Temperature := HeaterTemperature, Output := HeaterPower); END_IF;",
        "  2. wire a contactor in series with the heater's switch: on while Monitor.Told = 0",
        f"Alarms: {alarm_text()}",
    ]


def _read(low_degC: float, step_degC: float, highest: int) -> str:
    """Return the statements that make whole numbers of temperature and output; what is no number is below the card."""
    low, high = literal(single(low_degC)), literal(single(low_degC + highest * step_degC))
    above = f"Temperature {'+' if low_degC < 0.0 else '-'} {literal(single(abs(low_degC)))}"
    return (
        f"IF NOT (Temperature >= {low}) THEN (* also where it is no number *)\n  Reading := -1;\n"
        f"ELSIF Temperature > {high} THEN\n  Reading := {highest + 1};\n"
        f"ELSE\n  Reading := TRUNC(({above}) * {literal(single(1.0 / step_degC))} + 0.5);\nEND_IF;\n"
        "Power := TRUNC(Output + 0.5);\n")


def _printed(group: Group) -> str:
    return _indented(f"(* {group.title} *)\n{group.lines}")


def _indented(lines: str) -> str:
    return "".join(f"  {line}\n" for line in lines.splitlines())


class StructuredText:
    """The block in a machine for structured text, see `heatertune.supervision.text.program_check.LoadedText`."""

    def __init__(self, text: str, *, low_degC: float, step_degC: float) -> None:
        """Load it; raise InputError where it has what the machine does not know."""
        self._program = TextProgram(units(text + _CALLER), {})
        self._low, self._step = low_degC, step_degC

    def start(self) -> None:
        """Run it once while the heater is off."""
        self._program["Runs"] = False
        self._program.scan()

    def acknowledge(self) -> None:
        """Press the button, with the heater on or off as it is."""
        self._program["Acknowledge"] = True

    def outputs(self) -> list[tuple[float, float]]:
        """Return outputs of the controller and the power that each is [%]."""
        return [(tenths / 10.0, tenths / 10.0) for tenths in range(1001)]

    def output_of(self, percent: int) -> float:
        """Return an output of the controller that is so much power."""
        return float(percent)

    def call(self, count: int, output: float) -> tuple[int, int, int]:
        """Run the block; return its alarm, the first one kept, and the power in whole percent."""
        program = self._program
        program["Runs"] = True
        program["Temperature"], program["Output"] = single(self._low + count * self._step), single(output)
        program.scan()
        program["Acknowledge"] = False
        return program["Alarm"], program["Told"], program["Power"]
