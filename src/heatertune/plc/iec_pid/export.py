"""Words → structured text: the block, a program that calls it, and both as a PLCopen project.

No file was tried in a vendor's tool; parsers of the language and the format read them.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from heatertune.plc.iec_pid.source import SOURCE
from heatertune.plc.iec_pid.words import COUNTS, FIELDS
from heatertune.plc.keyed_entry import entry_texts
from heatertune.plc.st.head import by_hand, head_of
from heatertune.plc.st.plcopen import project
from heatertune.plc.st.program import (
    ProgramLimits,
    clock_for,
    enable_condition,
    instance_call,
    literal,
    program,
    proven_setpoint,
    statements,
    variables,
)
from heatertune.plc.st.source import comment, function_block
from heatertune.plc.words import Certificate, WordField, Words

__all__ = ["PROJECT", "TEXT", "constants", "entries", "export_words", "setpoint_entry"]

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


def entries(words: Words, _setpoint_degC: float | None, _units: object) -> dict[str, dict[str, str]]:
    """Return each word as the exported files have it, see `heatertune.plc.keyed_entry.TypedWord`."""
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


def setpoint_entry(words: Words, setpoint_degC: float, _units: int) -> str:
    """Return the setpoint as a person enters it, see `heatertune.plc.controller.Controller`."""
    value = literal(proven_setpoint(words, Certificate(verdict="", setpoint_degC=setpoint_degC), COUNTS))
    return f"HeaterSetPoint = {value} °C"
