"""CONT_C's instance data block as STL source with its calls, and all words as CSV with their offsets."""

from __future__ import annotations

from typing import Final

from heatertune.plc.cpu.s7_300 import awl
from heatertune.plc.cpu.s7_300.ramp import WORD, ramp_begins, ramp_moves
from heatertune.plc.fb41.words import FIELDS
from heatertune.plc.words import Certificate, Words

__all__ = ["export_words"]

_DB: Final = 41
#: the setpoint that the user enters: in °C, or, where a ramp leads it, as an analog value
_ASKED: Final = "MD 20"
_ASKED_COUNTS: Final = "MW 20"
#: SP_INT on the ramp
_LED: Final = "MD 34"


def export_words(words: Words, certificate: Certificate) -> dict[str, str | bytes]:
    """Return source and table; the same words and certificate give the same bytes.

    FB41 itself is not part of the source: it comes with STEP 7 (Standard Library, PID Control Blocks).
    """
    low, factor = words.values["PV_OFF"], words.values["PV_FAC"]
    asked = f"SP_INT in degC, enter yours in {_ASKED}" if words.ramp is None else (
        f"setpoint 27648/100 * (degC {0.0 - low:+g})/{factor:g}, rounded, in {_ASKED_COUNTS}: OB 35 leads SP_INT there"
    )
    head = awl.head(
        "instance of CONT_C (FB 41; on a CPU 31xC write SFB 41 for FB 41)", words, certificate,
        f"PV = PV_PER * 100/27648 * {factor:g} + {low:g}, in degC; {asked}",
        f"OB 35 must be called every {words.values['CYCLE']} ms (hardware configuration)",
        "FB 41 must be in the program: Standard Library, PID Control Blocks",
    )
    return {
        "fb41_cont_c.awl": awl.text([*head, *_data_block(words), *_restart(words), *_interrupt(words)]),
        "fb41_words.csv": awl.table(FIELDS, words),
    }


def _data_block(words: Words) -> list[str]:
    values = [
        f"  {f.name} := {awl.literal(f.format, words.values[f.name])} ;  // {f.address}: {f.comment}" for f in FIELDS
    ]
    return [
        f"DATA_BLOCK DB {_DB}", "TITLE =instance of the heater's controller", "VERSION : 0.1", "FB 41", "BEGIN",
        "  COM_RST := FALSE ;", *values, "END_DATA_BLOCK", "",
    ]


def _restart(words: Words) -> list[str]:
    return [
        "ORGANIZATION_BLOCK OB 100", "TITLE =restart of the controller", "VERSION : 0.1", "BEGIN", "NETWORK",
        "TITLE =COM_RST clears what the block remembers",
        f"      CALL  FB 41 , DB {_DB} (", "           COM_RST := TRUE);",
        *([] if words.ramp is None else ramp_begins(words.ramp)), "END_ORGANIZATION_BLOCK", "",
    ]


def _interrupt(words: Words) -> list[str]:
    return [
        "ORGANIZATION_BLOCK OB 35", "TITLE =cyclic interrupt: one call of the controller", "VERSION : 0.1", "BEGIN",
        "NETWORK", "TITLE =tie these to your inputs and outputs", *_ramp(words), f"      CALL  FB 41 , DB {_DB} (",
        "           COM_RST := FALSE,", f"           SP_INT := {_ASKED if words.ramp is None else _LED},",
        "           PV_PER := PIW 256,", "           LMN := MD 24,", "           LMN_PER := PQW 256);",
        "END_ORGANIZATION_BLOCK",
    ]


def _ramp(words: Words) -> list[str]:
    """Return the statements that lead SP_INT: the ramp in counts, then °C by the operations that make PV of PV_PER."""
    if words.ramp is None:
        return []
    factor, low = (awl.real(words.values[name]) for name in ("PV_FAC", "PV_OFF"))
    return [
        *ramp_moves(words.ramp, _ASKED_COUNTS),
        f"      L     {WORD};", "      ITD   ;", "      DTR   ;",
        f"      L     {awl.real(100.0)};", "      *R    ;", f"      L     {awl.real(27648.0)};", "      /R    ;",
        f"      L     {factor};", "      *R    ;", f"      L     {low};", "      +R    ;", f"      T     {_LED};",
    ]
