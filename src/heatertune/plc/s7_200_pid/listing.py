"""The program around the PID instruction as statement list: loop table at VB100, AIW0 in, PWM on Q0.0 out."""

from __future__ import annotations

from collections.abc import Sequence

from heatertune.plc.cpu.s7_200.cycle import cycle_ms
from heatertune.plc.cpu.s7_200.ramp import ramp_begins, ramp_moves
from heatertune.plc.cpu.s7_200.text import Network, block, count_ticks, program, pwm_registers, real, timed_interrupt
from heatertune.plc.inputs import BROKEN_MA, FOUR_TO_TWENTY, has_ends, share_of
from heatertune.plc.s7_200_pid.words import FULL, RANGES, SETPOINT, TABLE
from heatertune.plc.words import Words

__all__ = ["COUNTDOWN", "SETPOINT_INPUT", "in_degrees", "least_good", "pid_program"]

#: where a program with a ramp finds the setpoint asked for, as an analog input word
SETPOINT_INPUT = "VW80"
#: ticks to go
COUNTDOWN = "VW90"

_WIDEST = "32000.0"  # an analog input at the end of its range
#: setpoint asked for, setpoint on the ramp, countdown
_RAMP = (SETPOINT_INPUT, "VW82", "VW84")
#: the reading of this call, whether it is that of a broken wire, and whether there was one since the call before
_READING, _BROKEN, _BLIND = "VW86", "VW88", "VW92"
_END = 32766  # what an EM231 gives in size where its supply is missing, and nearly so where a wire is broken
#: where OB1 leaves what it reads of an EM 231 for temperatures, that this goes on
_READ = "VW94"


def pid_program(words: Words, head: Sequence[str] = ()) -> str:
    """Return the program; the same words and head give the same bytes."""
    first = Network("first scan", ["LD SM0.1", "CALL SBR0"])
    read = Network("the module has a new value only after the last one was read", ["LD SM0.0", f"MOVW AIW0, {_READ}"])
    main = [first, *([read] if in_degrees(words) else [])]
    return program(
        block("OB1", "PID instruction with PWM output", main, head),
        block("SBR0", "loop table, PWM on Q0.0, timed interrupt", _initialisation(words)),
        block("INT0", "one sampling interval: PID, pulse width", _interrupt(words)),
    )


def _initialisation(words: Words) -> list[Network]:
    v = words.values
    named = zip(("KC", "TS", "TI", "TD"), range(TABLE + 12, TABLE + 28, 4), strict=True)
    return [
        Network("loop table: gain, sampling interval, times in minutes", [
            "LD SM0.0", *[f"MOVR {real(v[name])}, VD{place}" for name, place in named],
        ]),
        Network("output and bias begin at 0", [
            "LD SM0.0", f"MOVR 0.0, VD{TABLE + 8}", f"MOVR 0.0, VD{TABLE + 28}", f"MOVW +1, {COUNTDOWN}",
            f"MOVW +0, {_BLIND}",
        ]),
        Network("reading of the call before: the one at the start, whatever V memory retained",
                _share("AIW0", f"VD{TABLE + 32}")),
        *([] if words.ramp is None else [ramp_begins(words.ramp, "AIW0", *_RAMP[1:])]),
        pwm_registers(cycle_ms(words.whole), "16#DB"),
        timed_interrupt(words.whole["TICK"]),
    ]


def _interrupt(words: Words) -> list[Network]:
    return [
        *count_ticks(COUNTDOWN, f"{words.whole['TICKS']:+d}"),
        *_sensor_fault(words),
        Network("process variable as a share of the range", _share(_READING, f"VD{TABLE}")),
        _seeing_again(words),
        *_setpoint(words),
        Network("setpoint: see VD104; PID", ["LD SM0.0", f"PID VB{TABLE}, 0"]),
        Network("pulse width; the cycle time is loaded once", [
            "LD SM0.0", f"MOVR VD{TABLE + 8}, AC0", f"*R {real(cycle_ms(words.whole))}, AC0", "ROUND AC0, AC0",
            "MOVW AC0, SMW70", "PLS 0", "MOVB 16#DA, SMB67",
        ]),
    ]


def _share(word: str, place: str) -> list[str]:
    return ["LD SM0.0", f"ITD {word}, AC0", "DTR AC0, AC0", f"/R {_WIDEST}, AC0", f"MOVR AC0, {place}"]


def _sensor_fault(words: Words) -> list[Network]:
    """Return what leaves the heater off, and the PID instruction out, while the sensor's wire is broken."""
    least = least_good(words)
    low = ("wire broken, the other way", -_END - 1) if least is None else ("wire broken: below 3.6 mA", least - 1)
    return [
        Network("one reading for all of this call", ["LD SM0.0", f"MOVW AIW0, {_READING}", f"MOVW +0, {_BROKEN}"]),
        Network("wire broken", [f"LDW>= {_READING}, +{_END}", f"MOVW +1, {_BROKEN}"]),
        Network(low[0], [f"LDW<= {_READING}, {low[1]:+d}", f"MOVW +1, {_BROKEN}"]),
        Network("heater off, output and bias 0, no PID", [
            f"LDW>= {_BROKEN}, +1", f"MOVR 0.0, VD{TABLE + 8}", f"MOVR 0.0, VD{TABLE + 28}", f"MOVW +1, {_BLIND}",
            "MOVW +0, SMW70", "PLS 0", "MOVB 16#DA, SMB67", "CRETI",
        ]),
    ]


def least_good(words: Words) -> int | None:
    """Return the least word of a transmitter whose wire is not broken; None: its sensor is none of 4 to 20 mA."""
    if words.scaling.input != FOUR_TO_TWENTY:
        return None
    return round(FULL * share_of(BROKEN_MA, RANGES[FOUR_TO_TWENTY]))


def in_degrees(words: Words) -> bool:
    """Return whether the analog module gives the temperature itself."""
    return has_ends(RANGES, words.scaling.input)


def _seeing_again(words: Words) -> Network:
    """Return what makes the first good reading after a fault the beginning of the loop, as after a start."""
    ramp = [] if words.ramp is None else [f"MOVW {_READING}, {_RAMP[1]}"]
    return Network("the first reading after that is the one before, too", [
        f"LDW>= {_BLIND}, +1", f"MOVR VD{TABLE}, VD{TABLE + 32}", *ramp, f"MOVW +0, {_BLIND}",
    ])


def _setpoint(words: Words) -> list[Network]:
    """Return what keeps the setpoint in the range, and how a ramp leads it; else the operator's panel writes it."""
    if words.ramp is None:
        return [
            Network("setpoint not above the range", [f"LDR>= {SETPOINT}, 1.0", f"MOVR 1.0, {SETPOINT}"]),
            Network("setpoint not below the range", [f"LDR<= {SETPOINT}, 0.0", f"MOVR 0.0, {SETPOINT}"]),
        ]
    asked, *led = _RAMP
    return [
        Network("setpoint not above the range", [f"LDW>= {asked}, +32000", f"MOVW +32000, {asked}"]),
        Network("setpoint not below the range", [f"LDW<= {asked}, +0", f"MOVW +0, {asked}"]),
        *ramp_moves(words.ramp, asked, _READING, *led),
        Network("setpoint as a share of the range", _share(led[0], SETPOINT)),
    ]
