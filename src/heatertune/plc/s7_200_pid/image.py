"""The loop table as the CPU holds it: 36 bytes, or 80 with the auto-tune part, REALs with their high byte first."""

from __future__ import annotations

import struct
from typing import Final

from heatertune.errors import InputError
from heatertune.plc.cpu.s7_200.cycle import ticks_of, whole_cycle
from heatertune.plc.ramp import Number
from heatertune.plc.s7_200_pid.words import NO_INTEGRAL
from heatertune.plc.words import Words

__all__ = ["from_image", "oddities", "to_image"]

_SHORT, _LONG = 36, 80
_ID: Final = b"PIDA"  # marks the extended table (System Manual, Table 6-44 of the later editions)

#: auto-tune part as the CPU sets it up: DEV, HYS, STEP, WDOG; the results 0
_AUTO_TUNE: Final = struct.pack(">4B 4f 5f", 0, 0, 0, 0, 0.1, 0.025, 0.1, 7200.0, *[0.0] * 5)


def to_image(words: Words, *, extended: bool = False) -> bytes:
    """Return 36 or 80 bytes; process variable, setpoint, output, bias and last process variable are 0."""
    v = words.values
    table = struct.pack(">9f", 0.0, 0.0, 0.0, v["KC"], v["TS"], v["TI"], v["TD"], 0.0, 0.0)
    return table + (_ID + _AUTO_TUNE if extended else b"")


def from_image(image: bytes, sample_time_s: float, source: str) -> dict[str, Number]:
    """Return the values in a loop table of 36 or 80 bytes, whose Ts may be another than the sampling interval [s].

    Raises:
        InputError: another length, or 80 bytes without the mark of the extended table.
        NotRepresentable: an interval that the PWM program cannot do.
    """
    if len(image) not in (_SHORT, _LONG):
        raise InputError(f"{source}: {len(image)} bytes; expected {_SHORT} or {_LONG} (loop table)")
    if len(image) == _LONG and image[_SHORT : _SHORT + 4] != _ID:
        raise InputError(f"{source}: {image[_SHORT:_SHORT + 4]!r} at byte {_SHORT}; expected {_ID!r} (extended table)")
    kc, ts, ti, td = struct.unpack(">4f", image[12:28])
    return {"KC": kc, "TS": ts, "TI": min(ti, NO_INTEGRAL), "TD": td, **ticks_of(whole_cycle(sample_time_s))}


def oddities(words: Words) -> tuple[str, ...]:
    """Return what is odd about a loop's words, one sentence each."""
    v = words.values
    odd = []
    if v["KC"] == 0.0:
        odd.append("KC is 0: there is no proportional part; the integral and derivative parts act with a gain of 1.")
    if v["KC"] < 0.0:
        odd.append("KC is negative: the loop cools.")
    if v["TI"] == NO_INTEGRAL:
        odd.append("TI is infinite: the loop has no integral action.")
    elif v["TI"] * 60.0 < 2.0 * v["TS"]:
        odd.append(f"TI is {v['TI']:.4g} min, below two samples: was it meant in seconds?")
    if abs(v["TS"] - words.sample_time_s) > 0.01 * words.sample_time_s:
        odd.append(f"TS is {v['TS']:.4g} s, but the loop is called every {words.sample_time_s:g} s: "
                   "TN and TV are realised as many times longer or shorter.")
    return tuple(odd)
