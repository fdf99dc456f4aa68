"""Words → structured text: a program with WEG's block, one with a block of its own, and that one as a PLCopen project.

None of the files was tried in WPS or in another vendor's tool; parsers of the language and the format read them.
"""

from __future__ import annotations

from typing import Final

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
from heatertune.plc.weg.program import KEEPS, PROBE, PROBED, ts_variables
from heatertune.plc.weg.source import SOURCE
from heatertune.plc.weg.words import COUNTS, FIELDS, REVERSE
from heatertune.plc.words import Certificate, Words

__all__ = ["RENAMED", "entries", "export_words", "setpoint_entry"]

_WIRES = (
    ("ManualSetPoint", "HandPower"), ("SelectSetPoint", "ByHand"),
    ("Feedback", "HeaterTemperature"),
)

#: input of WEG's block → input of the exported one, where the language reserves the name
RENAMED: Final = {"Type": "Form", "Action": "Acting"}


def export_words(words: Words, certificate: Certificate) -> dict[str, str]:
    """Return the three files; the same words and certificate give the same bytes."""
    clock, setpoint = clock_for(words, certificate.actuator), proven_setpoint(words, certificate, COUNTS)
    known = certificate.switches.get("sampling")
    kept = None if known is None else known == "block"
    head = (
        *head_of("heater controller for WEG's PID block", words, words.whole["Ts"], certificate, clock,
                 tool="WPS or another vendor's tool"),
        *by_hand(clock, certificate, of_clock=[_who_keeps_ts(known)],
                 of_start=["HeaterOn has to stay TRUE: each time that it rises the first call gives 0"]))
    remarks = comment(*head)
    limits = ProgramLimits(words.values["MaximumOutput"], words.values["Action"] == REVERSE)
    own = variables(words, clock, setpoint)
    body = statements(words, clock, _block_call(words), limits)
    wegs = variables(words, clock, setpoint, ts_variables(kept))
    calls = statements(words, clock, _weg_call(words), limits, before=PROBED if kept is None else "", or_when=KEEPS)
    instances = {"HeaterPid": "FB_PID"} | ({PROBE: "FB_PID"} if kept is None else {})
    return {
        "weg_pid_call.st": remarks + program("WegHeater", instances, wegs, calls),
        "weg_pid_block.st":
            remarks + function_block(SOURCE) + "\n" + program("Heater", {"HeaterPid": SOURCE.name}, own, body),
        "weg_pid_plcopen.xml": project(SOURCE, own, body, head, clock.tick_ms),
    }


def _who_keeps_ts(known: str | None) -> str:
    """Return what is known of it, or that the program finds out."""
    if known == "block":
        return "WEG's block keeps Ts itself, as you told (block): BlockKeepsTs is TRUE, and it is called each scan"
    if known is not None:
        return f"WEG's block is called each Ts, as you told ({known}): BlockKeepsTs is FALSE"
    return (f"who keeps Ts, WEG's block or its caller, the first scan after each start-up finds out ({PROBE}): "
            "BlockKeepsTs then shows it; a ladder of your own has to know")


def entries(words: Words, _setpoint_degC: float | None, _units: object) -> dict[str, dict[str, str]]:
    """Return each word as the exported files have it, see `heatertune.plc.keyed_entry.TypedWord`."""
    return entry_texts(dict(_values(words)))


def _values(words: Words) -> list[tuple[str, str]]:
    return [
        (f.name, literal(words.values[f.name]) if f.format == "REAL" else str(words.whole[f.name])) for f in FIELDS
    ]


def _wires(words: Words) -> list[tuple[str, str]]:
    return [("SetPoint", "HeaterSetPoint" if words.ramp is None else "HeaterRamp"), *_WIRES]


def _weg_call(words: Words) -> str:
    """Return the statements in the form of the manual's example: EN and Output as members."""
    call = instance_call("HeaterPid", [*_wires(words), *_values(words)])
    return f"HeaterPid.EN := {enable_condition(words)};\n{call}HeaterPower := HeaterPid.Output;\n"


def _block_call(words: Words) -> str:
    values = [(RENAMED.get(name, name), value) for name, value in _values(words)]
    call = instance_call("HeaterPid", [("Enable", enable_condition(words)), *_wires(words), *values])
    return f"{call}HeaterPower := HeaterPid.Output;\n"


def setpoint_entry(words: Words, setpoint_degC: float, _units: int) -> str:
    """Return the setpoint as a person enters it, see `heatertune.plc.controller.Controller`."""
    value = literal(proven_setpoint(words, Certificate(verdict="", setpoint_degC=setpoint_degC), COUNTS))
    return f"HeaterSetPoint = {value} °C"
