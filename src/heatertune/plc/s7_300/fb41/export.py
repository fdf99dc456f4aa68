"""CONT_C's instance data block as STL source with its calls, and all words as CSV with their offsets."""

from __future__ import annotations

from typing import Final

from heatertune.plc.room import Certificate, Words
from heatertune.plc.s7_300 import awl
from heatertune.plc.s7_300.fb41.words import FIELDS

__all__ = ["export_words"]

_DB: Final = 41


def export_words(words: Words, certificate: Certificate) -> dict[str, str | bytes]:
    """Return source and table; the same words and certificate give the same bytes.

    FB41 itself is not part of the source: it comes with STEP 7 (Standard Library, PID Control Blocks).
    """
    low, factor = words.values["PV_OFF"], words.values["PV_FAC"]
    head = awl.head(
        "instance of CONT_C (FB 41; on a CPU 31xC write SFB 41 for FB 41)", words, certificate,
        f"PV = PV_PER * 100/27648 * {factor:g} + {low:g}, in degC; SP_INT in degC, enter yours in MD 20",
        f"OB 35 must be called every {words.values['CYCLE']} ms (hardware configuration)",
        "FB 41 must be in the program: Standard Library, PID Control Blocks",
    )
    return {
        "fb41_cont_c.awl": awl.text([*head, *_data_block(words), *_restart(), *_interrupt()]),
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


def _restart() -> list[str]:
    return [
        "ORGANIZATION_BLOCK OB 100", "TITLE =restart of the controller", "VERSION : 0.1", "BEGIN", "NETWORK",
        "TITLE =COM_RST clears what the block remembers",
        f"      CALL  FB 41 , DB {_DB} (", "           COM_RST := TRUE);", "END_ORGANIZATION_BLOCK", "",
    ]


def _interrupt() -> list[str]:
    return [
        "ORGANIZATION_BLOCK OB 35", "TITLE =cyclic interrupt: one call of the controller", "VERSION : 0.1", "BEGIN",
        "NETWORK", "TITLE =tie these to your inputs and outputs", f"      CALL  FB 41 , DB {_DB} (",
        "           COM_RST := FALSE,", "           SP_INT := MD 20,", "           PV_PER := PIW 256,",
        "           LMN := MD 24,", "           LMN_PER := PQW 256);", "END_ORGANIZATION_BLOCK",
    ]
