"""A program that calls the PID of the target's own library, with the faults of that in its head.

The block's parameters in text: its call in structured text, or a list of parameters, one a line.
"""

from __future__ import annotations

from typing import Final

from heatertune.errors import InputError
from heatertune.plc.iec_pid.export import UNITS, constants
from heatertune.plc.iec_pid.words import COUNTS
from heatertune.plc.iec_pid_text.faults import faults
from heatertune.plc.iec_pid_text.words import FIELDS
from heatertune.plc.keyed_entry import entry_texts
from heatertune.plc.readback import ReadBack
from heatertune.plc.st.program_text import (
    ProgramLimits,
    clock_for,
    comment,
    head_of,
    instance_call,
    program,
    proven_setpoint,
    statements,
    variables,
)
from heatertune.plc.st.readback import ExpectedBlock, words_in
from heatertune.plc.words import Certificate, EntryChange, Words

__all__ = ["TEXT", "entries", "export_words", "from_text"]


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
