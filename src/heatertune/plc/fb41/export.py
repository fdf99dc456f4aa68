"""CONT_C's instance data block as STL source with the whole program around it, and all words as CSV with offsets."""

from __future__ import annotations

from typing import Final

from heatertune.plc.cpu.s7_300 import awl
from heatertune.plc.cpu.s7_300.cells import BlockMember
from heatertune.plc.cpu.s7_300.hardware import FULL_SCALE
from heatertune.plc.cpu.s7_300.program import BlockProgram, by_hand, counts_of, whole_number
from heatertune.plc.cpu.s7_300.real import quotient, real
from heatertune.plc.cpu.s7_300.switch import PULSEGEN, PwmSource, like, pwm_source
from heatertune.plc.fb41.words import FIELDS
from heatertune.plc.words import Certificate, Words

__all__ = ["export_words", "setpoint_entry", "source"]

_DB: Final = 41
_LMN: Final = f"DB{_DB}.DBD   72"


def export_words(words: Words, certificate: Certificate) -> dict[str, str | bytes]:
    """Return source and table; the same words and certificate give the same bytes.

    FB41 itself is not part of the source: it comes with STEP 7 (Standard Library, PID Control Blocks).
    """
    return {"fb41_cont_c.awl": _source(words, certificate, pwm_source(words, certificate, real=True)),
            "fb41_words.csv": awl.table(FIELDS, words)}


def source(words: Words, by: str) -> str:
    """Return the source of words whose heater is switched by these means, for a comparison of statements alone."""
    return _source(words, Certificate(verdict=""), like(words, by))


def _source(words: Words, certificate: Certificate, switch: PwmSource) -> str:
    low, factor = words.values["PV_OFF"], words.values["PV_FAC"]
    asked = "SP in degC" if words.ramp is None else (
        f"SP = {FULL_SCALE}/100 * (degC {0.0 - low:+g})/{factor:g}, {whole_number(words)}: OB 35 leads SP_INT there"
    )
    library = "FB 41 must be in the program" if switch.by != PULSEGEN else "FB 41 and FB 43 must be in the program"
    head = awl.head(
        "instance of CONT_C (FB 41; on a CPU 31xC write SFB 41 for FB 41)", words, certificate,
        f"PV = PV_PER * 100/{FULL_SCALE} * {factor:g} + {low:g}, in degC; {asked}",
        *by_hand(words, certificate, switch, f"{library}: Standard Library, PID Control Blocks"),
    )
    program = _program(words, certificate, switch)
    return awl.text([*head, *_data_block(words), *program.blocks, *program.restart([]), *program.interrupt])


def _program(words: Words, certificate: Certificate, switch: PwmSource) -> BlockProgram:
    return BlockProgram(
        input=words.scaling.input,
        real=True, setpoint=_setpoint(words, certificate), output=_LMN, word=f"DB{_DB}.DBW   76", ramp=words.ramp,
        switch=switch, temporaries=("raw : WORD", "manual : BOOL", *(() if words.ramp is None else ("led : REAL",))),
        begins=[f"      CALL  FB {_DB} , DB {_DB} (", "           COM_RST := TRUE);"],
        manual=lambda _: [],
        call=lambda at: [
            *_led(words, at["LED"] if words.ramp is not None else ""),
            "      L     #reading;", "      T     #raw;", f"      AN    {at['AUTO']};", "      =     #manual;",
            f"      CALL  FB {_DB} , DB {_DB} (", "           COM_RST := FALSE,", "           MAN_ON := #manual,",
            f"           SP_INT := {at['SP'] if words.ramp is None else '#led'},", "           PV_PER := #raw,",
            f"           MAN := {at['POWER']});",
        ])


def _setpoint(words: Words, certificate: Certificate) -> BlockMember:
    """Return the setpoint as the proof had it: an analog value, which a ramp takes as it is, and the block in °C."""
    low, proven = words.scaling.low_degC, certificate.setpoint_degC
    asked = counts_of(words, low if proven is None else proven)
    if words.ramp is not None:
        return BlockMember("SP", "INT", asked, f"setpoint, yours: 0..{FULL_SCALE}")
    share = quotient(real(asked * 100.0)[0], FULL_SCALE)[0]
    scaled = real(real(share * words.values["PV_FAC"])[0] + words.values["PV_OFF"])[0]
    return BlockMember("SP", "REAL", scaled, "setpoint, yours: degC")


def _data_block(words: Words) -> list[str]:
    values = [
        f"  {f.name} := {awl.literal(f.format, words.values[f.name])} ;  // {f.address}: {f.comment}" for f in FIELDS
    ]
    return [
        f"DATA_BLOCK DB {_DB}", "TITLE =instance of the heater's controller", "VERSION : 0.1", "FB 41", "BEGIN",
        "  COM_RST := FALSE ;", *values, "END_DATA_BLOCK", "",
    ]


def _led(words: Words, led: str) -> list[str]:
    """Return the statements that make °C of the setpoint on its ramp, by the operations that make PV of PV_PER."""
    if words.ramp is None:
        return []
    factor, low = (awl.real(words.values[name]) for name in ("PV_FAC", "PV_OFF"))
    return [
        f"      L     {led};", "      ITD   ;", "      DTR   ;", f"      L     {awl.real(100.0)};", "      *R    ;",
        f"      L     {awl.real(FULL_SCALE)};", "      /R    ;", f"      L     {factor};", "      *R    ;",
        f"      L     {low};", "      +R    ;", "      T     #led;",
    ]


def setpoint_entry(words: Words, setpoint_degC: float, _units: int) -> str:
    """Return the setpoint as a person enters it, see `heatertune.plc.controller.Controller`."""
    value = _setpoint(words, Certificate(verdict="", setpoint_degC=setpoint_degC)).value
    return f"SP (DBD 2 of DB 101) = {value:.9g} °C" if words.ramp is None else f"SP (DBW 2 of DB 101) = {value}"
