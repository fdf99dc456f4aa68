"""The tip as STL source, the whole program around it included; the four words as CSV."""

from __future__ import annotations

from typing import Final

from heatertune.plc.cpu.s7_300 import awl
from heatertune.plc.cpu.s7_300.cells import BlockMember
from heatertune.plc.cpu.s7_300.hardware import FULL_SCALE
from heatertune.plc.cpu.s7_300.program import BlockProgram, by_hand, counts_of, whole_number
from heatertune.plc.cpu.s7_300.switch import PULSEGEN, PwmSource, like, pwm_source
from heatertune.plc.s7_300.listing import STATEMENTS, VARIABLES
from heatertune.plc.s7_300.words import FIELDS
from heatertune.plc.words import Certificate, Words

__all__ = ["export_words", "setpoint_entry", "source"]

#: number of the function block and of its instance data block: free in most programs
_NUMBER: Final = 100
_OUT: Final = f"DB{_NUMBER}.DBW    6"


def export_words(words: Words, certificate: Certificate) -> dict[str, str | bytes]:
    """Return source and table; the same words and certificate give the same bytes.

    The data block gives every member its value in BEGIN; OB100 loads the four words bit by bit after each restart.
    """
    return {"s7_300_pid.awl": _source(words, certificate, pwm_source(words, certificate, real=False)),
            "s7_300_words.csv": awl.table(FIELDS, words)}


def source(words: Words, by: str) -> str:
    """Return the source of words whose heater is switched by these means, for a comparison of statements alone."""
    return _source(words, Certificate(verdict=""), like(words, by))


def _source(words: Words, certificate: Certificate, switch: PwmSource) -> str:
    low, span = words.scaling.low_degC, words.scaling.span_degC
    pulsegen = ["FB 43 PULSEGEN must be in the program: Standard Library, PID Control Blocks"]
    head = awl.head(
        "PID of S7-300/400 application tip No. 2: the document's equations, heatertune's statements",
        words, certificate,
        f"setpoint SP = {FULL_SCALE}/{span:g} * (degC {0.0 - low:+g}), {whole_number(words)}",
        *by_hand(words, certificate, switch, *(pulsegen if switch.by == PULSEGEN else [])),
    )
    program = _program(words, certificate, switch)
    return awl.text([*head, *_function_block(), *_data_block(words), *program.blocks,
                     *program.restart(_loads(words)), *program.interrupt])


def _program(words: Words, certificate: Certificate, switch: PwmSource) -> BlockProgram:
    asked = 0 if certificate.setpoint_degC is None else counts_of(words, certificate.setpoint_degC)
    setpoint = "SP" if words.ramp is None else "LED"
    return BlockProgram(
        input=words.scaling.input,
        real=False, setpoint=BlockMember("SP", "INT", asked, f"setpoint, yours: 0..{FULL_SCALE}"), output=_OUT,
        word=_OUT,
        ramp=words.ramp, switch=switch, temporaries=("share : REAL",) if switch.by == PULSEGEN else (),
        begins=[
            f"      L     {awl.bits(0.0)};", f"      T     DB{_NUMBER}.DBD   26;  // BIAS", "      CLR   ;",
            f"      =     DB{_NUMBER}.DBX   34.0;  // STARTED", "      L     0;", f"      T     {_OUT};  // OUT",
        ],
        manual=lambda at: [f"      L     {at['POWER']};", f"      T     {_OUT};"],
        call=lambda at: [
            f"      CALL  FB {_NUMBER} , DB {_NUMBER} (", f"           mode_req := {at['AUTO']},",
            "           PV := #reading,", f"           SP := {at[setpoint]});",
        ])


def _function_block() -> list[str]:
    return [
        f"FUNCTION_BLOCK FB {_NUMBER}", "TITLE =PID, application tip No. 2", "VERSION : 0.1",
        *VARIABLES.splitlines(), "BEGIN", *STATEMENTS.splitlines(), "END_FUNCTION_BLOCK", "",
    ]


def _data_block(words: Words) -> list[str]:
    values = [f"  {f.name} := {awl.real(words.values[f.name])} ;  // {f.address}: {f.comment}" for f in FIELDS]
    return [
        f"DATA_BLOCK DB {_NUMBER}", "TITLE =instance of the heater's PID", "VERSION : 0.1", f"FB {_NUMBER}", "BEGIN",
        "  mode_req := FALSE ;", "  PV := 0 ;", "  SP := 0 ;", "  OUT := 0 ;", "  OVERFLOW := FALSE ;", *values,
        f"  BIAS := {awl.real(0.0)} ;", f"  PV_LAST := {awl.real(0.0)} ;", "  STARTED := FALSE ;",
        "END_DATA_BLOCK", "",
    ]


def _loads(words: Words) -> list[str]:
    """Return the statements that load the four words."""
    loads = []
    for field in FIELDS:
        value = words.values[field.name]
        loads += [f"      L     {awl.bits(value)};  // {field.name} {value:.9g}",
                  f"      T     DB{_NUMBER}.DBD {field.address.removeprefix('DBD')};"]
    return loads


def setpoint_entry(_words: Words, _setpoint_degC: float, units: int) -> str:
    """Return the setpoint as a person enters it, see `heatertune.plc.controller.Controller`."""
    return f"SP (DBW 2 of DB 101) = {units}"
