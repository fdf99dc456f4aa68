"""Words as structured text: the block, a program that calls it, and both as a PLCopen project; and read back.

The FUNCTION_BLOCK is `step.call`, one statement per line of it; tests run both. TIME_TO_REAL gives seconds in one
system and other units in others; the quotient by T#1s is seconds in all. No file was tried in a vendor's tool;
independent parsers of the language and of the format read them.
"""

from __future__ import annotations

from collections.abc import Callable, Iterable, Mapping
from functools import partial
from typing import Final

from heatertune.plc.cpu.iec.machine import TextProgram
from heatertune.plc.cpu.iec.st_syntax import units
from heatertune.plc.iec_pid.step import IecPidAssumptions
from heatertune.plc.iec_pid.words import COUNTS, FIELDS
from heatertune.plc.keyed_entry import entry_texts
from heatertune.plc.readback import ReadBack
from heatertune.plc.st.exported_program import ExportedProgram, check_project
from heatertune.plc.st.plcopen import project
from heatertune.plc.st.program_text import (
    LARGEST,
    BlockSource,
    ProgramLimits,
    by_hand,
    clock_for,
    comment,
    enable_condition,
    entered_setpoint,
    function_block,
    head_of,
    instance_call,
    literal,
    program,
    proven_setpoint,
    statements,
    time_to_real,
    variables,
)
from heatertune.plc.st.readback import ExpectedBlock, words_in
from heatertune.plc.words import Certificate, EntryChange, WordField, Words

__all__ = [
    "PROJECT", "SOURCE", "TEXT", "UNITS", "constants", "entries", "export_words", "from_text", "loaders",
    "setpoint_entry",
]


UNITS: Final = {"KP": "%/°C", "TR": "s", "TD": "s", "XMIN": "%", "XMAX": "%", "CYCLE": "ms"}


def from_text(text: str, _sample_time_s: float | None, source: str) -> ReadBack:
    """Return the words in a text, and the inputs of the block that are none; errors as `words_in`."""
    return words_in(text, source, ExpectedBlock(FIELDS, UNITS))


SOURCE: Final = BlockSource("HT_IEC_PID", {
    "VAR_INPUT": (
        ("RUN", "BOOL", "", "FALSE: off, and the next call begins anew"),
        ("AUTO", "BOOL", "", "FALSE: by hand"),
        ("PV", "REAL", "", "temperature, degC"),
        ("SP", "REAL", "", "setpoint, degC"),
        ("X0", "REAL", "", "output by hand, %"),
        ("KP", "REAL", "", "% per degC; above 0 for a heater, below 0 for a cooler"),
        ("TR", "REAL", "", "reset time, s; 0: no I part"),
        ("TD", "REAL", "", "derivative time, s"),
        ("XMIN", "REAL", "", "lower limit of XOUT, %"),
        ("XMAX", "REAL", "", "upper limit of XOUT, %"),
        ("CYCLE", "TIME", "", "interval of the calls"),
    ),
    "VAR_OUTPUT": (
        ("XOUT", "REAL", "", "%"),
    ),
    "VAR": (
        ("Begun", "BOOL", "", "the memory below holds"),
        ("Seconds", "REAL", "", "CYCLE, s"),
        ("Error", "REAL", "", "SP - PV"),
        ("Error1", "REAL", "", "of the call before"),
        ("Error2", "REAL", "", "two calls ago"),
        ("Error3", "REAL", "", "three calls ago"),
        ("IntegralPart", "REAL", "", "I part, %"),
        ("Proportional", "REAL", "", "P part, %"),
        ("Slope", "REAL", "", "of the error, degC/s"),
        ("Sum", "REAL", "", "new I part"),
        ("Wanted", "REAL", "", "output before its limits"),
    ),
    "VAR CONSTANT": (
        ("Largest", "REAL", LARGEST, "the largest REAL"),
    ),
}, """\
IF NOT RUN THEN
  Begun := FALSE;
  XOUT := 0.0;
ELSE
  Seconds := TIME_TO_REAL(CYCLE) / TIME_TO_REAL(T#1s); (* whatever the unit of TIME_TO_REAL *)
  Error := SP - PV;
  Wanted := X0;
  IF ABS(Error) <= Largest THEN
    IF NOT Begun OR NOT AUTO THEN
      Error1 := Error;
      Error2 := Error;
      Error3 := Error;
    END_IF;
    IF NOT Begun THEN
      Begun := TRUE;
      IntegralPart := 0.0;
    END_IF;
    Proportional := KP * Error;
    IF AUTO THEN
      IF TR <> 0.0 THEN
        Sum := IntegralPart + ((KP * Seconds) / TR) * Error;
        IF Sum < XMIN - Proportional THEN (* P and I part together stay within the limits *)
          Sum := XMIN - Proportional;
        END_IF;
        IF Sum > XMAX - Proportional THEN
          Sum := XMAX - Proportional;
        END_IF;
        IF ABS(Sum) <= Largest THEN
          IntegralPart := Sum;
        END_IF;
      ELSE
        IntegralPart := 0.0;
      END_IF;
      Wanted := Proportional + IntegralPart;
      IF TD <> 0.0 THEN
        Slope := (3.0 * (Error - Error3) + Error1 - Error2) / (10.0 * Seconds);
        Wanted := Wanted + KP * (TD * Slope);
      END_IF;
      Error3 := Error2;
      Error2 := Error1;
      Error1 := Error;
    END_IF;
  ELSIF AUTO THEN (* a broken sensor or an overflow: nothing is remembered *)
    Wanted := XMIN;
  END_IF;
  XOUT := Wanted;
  IF NOT (XOUT >= XMIN) THEN (* also where it is no number: the heater goes off *)
    XOUT := XMIN;
  ELSIF XOUT > XMAX THEN
    XOUT := XMAX;
  END_IF;
  IF ABS(Error) <= Largest AND NOT AUTO THEN (* so that the return to automatic is without a bump *)
    Sum := 0.0;
    IF TR <> 0.0 THEN
      Sum := XOUT - Proportional;
    END_IF;
    IF ABS(Sum) <= Largest THEN
      IntegralPart := Sum;
    END_IF;
  END_IF;
END_IF;
""")


TEXT: Final = "iec_pid.st"
PROJECT: Final = "iec_pid_plcopen.xml"


def export_words(words: Words, certificate: Certificate) -> dict[str, str]:
    """Return both files; the same words and certificate give the same bytes."""
    clock = clock_for(words, certificate.actuator)
    title = "heater controller: the PID of IEC 61131-3, repaired"
    head = (*head_of(title, words, words.whole["CYCLE"], certificate, clock), *by_hand(clock, certificate))
    own = variables(words, clock, proven_setpoint(words, certificate, COUNTS))
    limits = ProgramLimits(most=words.values["XMAX"], cools=words.values["KP"] < 0.0)
    body = statements(words, clock, _call(words), limits)
    return {
        TEXT: comment(*head) + function_block(SOURCE) + "\n" + program("Heater", {"HeaterPid": SOURCE.name}, own, body),
        PROJECT: project(SOURCE, own, body, head, clock.tick_ms),
    }


def entries(words: Words, _setpoint_degC: float | None, _units: object) -> dict[str, EntryChange]:
    """Return each word as the exported files have it, see `heatertune.plc.keyed_entry.KeyedEntry`."""
    return entry_texts(dict(constants(words, FIELDS)))


def constants(words: Words, fields: Iterable[WordField]) -> list[tuple[str, str]]:
    """Return the words as literals of the language."""
    return [(f.name, f"T#{words.whole[f.name]}ms" if f.format == "TIME" else literal(words.values[f.name]))
            for f in fields]


def _call(words: Words) -> str:
    setpoint = "HeaterSetPoint" if words.ramp is None else "HeaterRamp"
    wires = [("RUN", enable_condition(words)), ("AUTO", "NOT ByHand"), ("PV", "HeaterTemperature"), ("SP", setpoint),
             ("X0", "HandPower"), *constants(words, FIELDS)]
    return f"{instance_call('HeaterPid', wires)}HeaterPower := HeaterPid.XOUT;\n"


#: the setpoint as a person enters it, see `heatertune.plc.controller.Controller`
setpoint_entry: Final = partial(entered_setpoint, COUNTS)


def loaders(
    files: Mapping[str, str | bytes], assume: IecPidAssumptions
) -> dict[str, Callable[[], ExportedProgram | None]]:
    """Return the functions that load each file, for a system whose TIME_TO_REAL is as assumed."""
    text, gives = str(files[TEXT]), partial(time_to_real, unit=assume.time_unit)
    return {TEXT: lambda: ExportedProgram(TextProgram(units(text), {}, gives)),
            PROJECT: lambda: check_project(str(files[PROJECT]), text, TEXT)}
