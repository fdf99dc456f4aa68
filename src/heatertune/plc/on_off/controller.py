"""The room of the two-level control that the bit processor runs: its four doors under one name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

from heatertune.plc.controller import Core, Room, Running, Scan, Timing, Words, count
from heatertune.plc.cpu.one_bit.machine import START, State, Wiring, scan
from heatertune.plc.cpu.one_bit.programs import ON_OFF_NAMES
from heatertune.plc.on_off.export import PROGRAM, export_words, from_image
from heatertune.plc.on_off.words import COUNTS, FIELDS, TIMER, check_words, encode
from heatertune.plc.open_points import NothingOpen

__all__ = ["ROOM", "OnOff"]

_OUT: Final = ON_OFF_NAMES.bits["OUT"]
_WIRING: Final = Wiring(results={ON_OFF_NAMES.bits["AC1<AC2"]: -1, ON_OFF_NAMES.bits["AC1>AC2"]: 1})

_INPUTS: Final = {"SP": "INT", "PV": "INT"}

_WIDE: Final = 0.1  # of the sensor range


def _step(
    band: int, state: State, setpoint: int, reading: int, _begins: bool
) -> tuple[State, float, int, int]:
    after = scan(PROGRAM, _WIRING, state, registers=(setpoint, reading, band))
    is_on = after.is_on(_OUT)
    return after, 100.0 if is_on else 0.0, int(is_on), int(after.overflow) + 2 * int(after.endless)


class _Memory(NamedTuple):
    is_on: bool = False


def _direct_step(
    band: int, state: _Memory, setpoint: int, reading: int, _begins: bool
) -> tuple[_Memory, float, int, int]:
    """Compute the same without the program: off above SP + BAND, on below SP − BAND, all in 16 bits."""
    w, x, b = _word(setpoint), _word(reading), _word(band)
    above, below = w + b, w - b
    overflow = above != _word(above)
    is_on = state.is_on
    if x > _word(above):
        is_on = False
    else:
        overflow = overflow or below != _word(below)
        is_on = is_on or x < _word(below)
    return _Memory(is_on), 100.0 if is_on else 0.0, int(is_on), int(overflow)


def _word(number: int) -> int:
    return ((number + 0x8000) & 0xFFFF) - 0x8000


def _direct(words: Words, _assume: NothingOpen) -> tuple[Core, Running]:
    return _DIRECT, Running(words.whole["BAND"], _Memory())


_DIRECT: Final = Core(step=_direct_step, measure=count, flags=("overflow", "endless"))
_CORE: Final = Core(step=_step, measure=count, flags=("overflow", "endless"), compiles=False)


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OnOff(Room):
    """See `heatertune.plc.controller.Room`."""

    def timing(self, words: Words) -> Timing:
        """Return the scan interval; the switch behind the output is an actuator, always on or off for a whole scan."""
        return Timing(scan_s=words.sample_time_s)

    def begin(self, words: Words, assume: NothingOpen) -> Running:  # noqa: ARG002 - the same door for all
        """Return the state after power-on: heater off."""
        return Running(words.whole["BAND"], START)

    def scan(self, state: Running, inputs: Mapping[str, int]) -> tuple[Running, Scan]:
        """Run one scan with SP and PV."""
        return _CORE.run(state, inputs["SP"], inputs["PV"], cycle_start=True)


def _decode(words: Words) -> None:
    """Return None: the controller is no PID."""
    del words


def _oddities(words: Words) -> tuple[str, ...]:
    """Return what is odd about the word of a running controller."""
    band = words.whole["BAND"]
    if band <= _WIDE * COUNTS:
        return ()
    degrees = band * words.scaling.span_degC / COUNTS
    return (f"BAND is {band}: the heater switches {degrees:.3g} °C above and below the setpoint.",)


ROOM: Final = OnOff(
    name="on-off",
    title="bit processor, two-level control (Hryniewicz, Chmiel, Przegląd Elektrotechniczny 88(9a), 2012, Ex. 3)",
    fields=FIELDS,
    assumptions=NothingOpen,
    inputs=_INPUTS,
    can=("switch the heater fully on below SP − BAND and off above SP + BAND",),
    cannot=(
        "no PID: of a design only TA is taken, as the scan interval",
        "the temperature swings around the setpoint, the more the longer the dead time",
        "no setpoint ramp in its program",
    ),
    counts=COUNTS,
    sample_times_s=TIMER,
    derivative_filter=0.5,
    encode=encode,
    decode=_decode,
    check=check_words,
    export=export_words,
    core=_CORE,
    direct=_direct,
    read_image=from_image,
    oddities=_oddities,
)
