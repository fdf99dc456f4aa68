"""The printed program as statement list (Alia 2007, Table 2; networks 5 to 12 from their descriptions).

The paper's INT1 is INT0 here, since Micro/WIN wants an INT0.
"""

from __future__ import annotations

from collections.abc import Sequence

from heatertune.plc.cpu.s7_200.text import Network, block, program
from heatertune.plc.words import Words

__all__ = ["printed_program"]


def printed_program(words: Words, head: Sequence[str] = ()) -> str:
    """Return the program; the same words and head give the same bytes."""
    return program(
        block("OB1", "PID/PWM heater controller, as printed in the paper", _main(words), head),
        block("SBR0", "initialization", _initialisation(words.whole["CYCLE"])),
        block("INT0", "output updating", _output()),
    )


def _main(words: Words) -> list[Network]:
    v = words.whole
    return [
        Network("1: first scan", ["LD SM0.1", "S Q0.0, 1", "CALL SBR0"]),
        Network("2: Q0.0 is wired to I0.0, its rising edge updates the output", ["LD SM0.0", "ATCH INT0, 0"]),
        Network("3: process variable", ["LD SM0.0", "MOVB IB0, VB0"]),
        Network("4: its bit 0 is wired to I1.0", ["LD I1.0", "= V0.0"]),
        Network("5: previous error, set point, error", [
            "LD SM0.0", "MOVW VW10, VW20", "MOVW SMW28, VW10", "-I VW0, VW10",
        ]),
        Network("6: proportional, integral, differential part", [
            "LD SM0.0", "MOVW VW20, AC0", f"MUL {v['KP']:+d}, AC0",
            "MOVW VW20, AC1", "+I VW10, AC1", f"MUL {v['KI']:+d}, AC1", f"MUL {v['T']:+d}, AC1", "+D AC1, AC0",
            "MOVW VW10, AC1", "-I VW20, AC1", f"MUL {v['KD']:+d}, AC1", f"DIV {v['T']:+d}, AC1", "+D AC1, AC0",
        ]),
        Network("7: scaling by 65536, VW100 is the high word", ["LD SM0.0", "MOVD AC0, VD100"]),
    ]


def _initialisation(cycle_ms: int) -> list[Network]:
    return [
        Network("10: PWM on Q0.0", [
            "LD SM0.0", "MOVB 16#CA, SMB67", f"MOVW {cycle_ms:+d}, SMW68", "MOVW +0, SMW70", "PLS 0", "ENI",
        ]),
    ]


def _output() -> list[Network]:
    return [
        Network("12: add to the pulse width", ["LD SM0.0", "+I VW100, SMW70"]),
        Network("not above the cycle", ["LDW>= SMW70, SMW68", "MOVW SMW68, SMW70"]),
        Network("not below zero", ["LDW<= SMW70, +0", "MOVW +0, SMW70"]),
        Network("out; no more edges in this scan", ["LD SM0.0", "PLS 0", "DTCH 0"]),
    ]
