"""The repaired program as statement list, written from its words.

Only instructions that a CPU 214 has are used. V memory: VW0, VW2, VW4 reading and its two predecessors; VW10, VW20
error and its predecessor; VW24, VW26, VW28 differences and sum; VW30 ticks to go; VW34, VW36 setpoint on its
ramp and calls to its next step; VD224 rest; constants from VW200.
"""

from __future__ import annotations

from collections.abc import Sequence

from heatertune.plc.cpu.s7_200.ramp import ramp_begins, ramp_moves
from heatertune.plc.cpu.s7_200.text import Network, block, count_ticks, program, pwm_registers, timed_interrupt
from heatertune.plc.words import Words

__all__ = ["COUNTDOWN", "repaired_program"]

#: ticks to go
COUNTDOWN = "VW30"
#: setpoint on the ramp, calls to its next step
_RAMP = ("VW34", "VW36")


def repaired_program(words: Words, head: Sequence[str] = ()) -> str:
    """Return the program; the same words and head give the same bytes."""
    first = Network("first scan", ["LD SM0.1", "CALL SBR0"])
    return program(
        block("OB1", "PID/PWM heater controller, repaired", [first], head),
        block("SBR0", "constants, PWM on Q0.0, timed interrupt", _initialisation(words)),
        block("INT0", "one PWM cycle: errors, increments, pulse width", _interrupt(words)),
    )


def _initialisation(words: Words) -> list[Network]:
    v = words.whole
    cycle, scale = v["TICK"] * v["TICKS"], v["SCALE"]
    return [
        Network("constants", [
            "LD SM0.0", f"MOVW {v['KP']:+d}, VW200", f"MOVW {v['KI']:+d}, VW202", f"MOVW {v['KD']:+d}, VW204",
            f"MOVW {v['TICKS']:+d}, VW208", f"MOVD {(1 << scale) - 1:+d}, VD212", f"MOVD {1 << (31 - scale):+d}, VD216",
            f"MOVD {cycle:+d}, VD220",
        ]),
        Network("nothing summed up, the first tick computes", [
            "LD SM0.0", "MOVD +0, VD224", "MOVW +0, VW10", f"MOVW +1, {COUNTDOWN}",
        ]),
        Network("process variable: IB0", ["LD SM0.0", "MOVW +0, VW0", "MOVB IB0, VB1"]),
        Network("its bit 0 is wired to I1.0", ["LD I1.0", "= V1.0"]),
        Network("no change of it before the start", ["LD SM0.0", "MOVW VW0, VW2"]),
        *([] if words.ramp is None else [ramp_begins(words.ramp, "VW0", *_RAMP)]),
        pwm_registers(cycle, "16#CB"),
        timed_interrupt(v["TICK"]),
    ]


def _ramped(words: Words) -> list[Network]:
    """Return the networks that put the setpoint on its ramp in the place of the one asked for."""
    if words.ramp is None:
        return []
    word, _ = _RAMP
    follow = Network("set point on its ramp", ["LD SM0.0", f"MOVW {word}, VW10"])
    return [*ramp_moves(words.ramp, "VW10", "VW0", *_RAMP), follow]


def _interrupt(words: Words) -> list[Network]:
    scale = words.whole["SCALE"]
    return [
        *count_ticks(COUNTDOWN, "VW208"),
        Network("set point: analog adjustment 0; process variable: IB0", [
            "LD SM0.0", "MOVW VW2, VW4", "MOVW VW0, VW2", "MOVW VW10, VW20",
            "MOVW +0, VW10", "MOVB SMB28, VB11", "MOVB IB0, VB1",
        ]),
        Network("its bit 0 is wired to I1.0", ["LD I1.0", "= V1.0"]),
        *_ramped(words),
        Network("error, its change and sum, second difference of the process variable", [
            "LD SM0.0", "-I VW0, VW10", "MOVW VW10, VW24", "-I VW20, VW24", "MOVW VW10, VW26", "+I VW20, VW26",
            "MOVW VW2, VW28", "-I VW0, VW28", "+I VW2, VW28", "-I VW4, VW28",
        ]),
        Network("KP*change + KI*sum + KD*second difference + rest", [
            "LD SM0.0", "MOVW VW24, AC0", "MUL VW200, AC0", "MOVW VW26, AC1", "MUL VW202, AC1", "+D AC1, AC0",
            "MOVW VW28, AC1", "MUL VW204, AC1", "+D AC1, AC0", "+D VD224, AC0",
        ]),
        Network("scaling: shift with sign, keep the rest", [
            "LD SM0.0", "MOVD AC0, VD224", "ANDD VD212, VD224", "XORD 16#80000000, AC0", f"SRD AC0, {scale}",
            "-D VD216, AC0",
        ]),
        Network("pulse width in 32 bits", ["LD SM0.0", "MOVD +0, AC2", "MOVW SMW70, AC2", "+D AC0, AC2"]),
        Network("not above the cycle", ["LDD>= AC2, VD220", "MOVD VD220, AC2"]),
        Network("not below zero", ["LDD<= AC2, +0", "MOVD +0, AC2"]),
        Network("out; the cycle time is loaded once", [
            "LD SM0.0", "MOVW AC2, SMW70", "PLS 0", "MOVB 16#CA, SMB67",
        ]),
    ]
