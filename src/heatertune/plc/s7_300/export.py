"""The tip as STL source: function block, instance data block, OB100 and OB35; OB1 beside it; the four words as CSV."""

from __future__ import annotations

from typing import Final

from heatertune.plc.cpu.s7_300 import awl
from heatertune.plc.cpu.s7_300.ramp import WORD, ramp_begins, ramp_moves
from heatertune.plc.s7_300.listing import STATEMENTS, VARIABLES
from heatertune.plc.s7_300.words import FIELDS
from heatertune.plc.words import Certificate, Words

__all__ = ["export_words"]

#: number of the function block and of its instance data block: free in most programs
_NUMBER: Final = 100
#: the setpoint that the user enters
_ASKED: Final = "MW 12"


def export_words(words: Words, certificate: Certificate) -> dict[str, str | bytes]:
    """Return source and table; the same words and certificate give the same bytes.

    The data block gives every member its value in BEGIN; OB100 loads the four words bit by bit after each restart.
    """
    low, span = words.scaling.low_degC, words.scaling.span_degC
    head = awl.head(
        "PID of S7-300/400 application tip No. 2: the document's equations, heatertune's statements",
        words, certificate,
        f"setpoint SP = 27648/{span:g} * (degC {0.0 - low:+g}), rounded; enter yours in {_ASKED}",
        f"OB 35 must be called every {1000 * words.sample_time_s:g} ms (hardware configuration)",
        "OB 1 is yours: where there is no OB 35, take the network of s7_300_ob1.awl into it instead",
    )
    source = [*head, *_function_block(), *_data_block(words), *_restart(words), *_interrupt(words)]
    files: dict[str, str | bytes] = {
        "s7_300_pid.awl": awl.text(source), "s7_300_words.csv": awl.table(FIELDS, words),
    }
    clock = awl.s5_time(words.sample_time_s)
    return files | ({} if clock is None else {"s7_300_ob1.awl": awl.text(_scan(clock, words))})


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


def _restart(words: Words) -> list[str]:
    loads = []
    for field in FIELDS:
        value = words.values[field.name]
        loads += [f"      L     {awl.bits(value)};  // {field.name} {value:.9g}",
                  f"      T     DB{_NUMBER}.DBD {field.address.removeprefix('DBD')};"]
    return [
        "ORGANIZATION_BLOCK OB 100", "TITLE =restart: load the words, begin from cold in automatic", "VERSION : 0.1",
        "BEGIN", "NETWORK", "TITLE =words", *loads,
        f"      L     {awl.bits(0.0)};", f"      T     DB{_NUMBER}.DBD 26;  // BIAS",
        *([] if words.ramp is None else ramp_begins(words.ramp)),
        "      SET   ;", f"      R     DB{_NUMBER}.DBX 34.0;  // STARTED", "      S     M 10.0;  // automatic",
        "END_ORGANIZATION_BLOCK", "",
    ]


def _interrupt(words: Words) -> list[str]:
    return [
        "ORGANIZATION_BLOCK OB 35", "TITLE =cyclic interrupt: one call of the PID", "VERSION : 0.1",
        "BEGIN", "NETWORK", "TITLE =tie these to your inputs and outputs", *_call(words), "END_ORGANIZATION_BLOCK",
    ]


def _scan(clock: str, words: Words) -> list[str]:
    """Return an OB1 that calls the block each time a timer has run; each period is longer by up to two scans."""
    return [
        "// instead of OB 35: one call each time T 1 has run, which makes every interval longer by up to two scans",
        "ORGANIZATION_BLOCK OB 1", "TITLE =scan", "VERSION : 0.1", "BEGIN", "NETWORK",
        "TITLE =tie these to your inputs and outputs", "      A     T 1;", "      JCN   wait;", *_call(words),
        "wait: AN    T 1;", f"      L     {clock};", "      SD    T 1;", "END_ORGANIZATION_BLOCK",
    ]


def _call(words: Words) -> list[str]:
    """Return the call of the block; with a ramp, first its statements."""
    ramp, setpoint = ([], _ASKED) if words.ramp is None else (ramp_moves(words.ramp, _ASKED), WORD)
    return [
        *ramp, f"      CALL  FB {_NUMBER} , DB {_NUMBER} (", "           mode_req := M 10.0,",
        "           PV := PIW 256,", f"           SP := {setpoint},", "           OUT := PQW 256,",
        "           OVERFLOW := M 10.1);",
    ]
