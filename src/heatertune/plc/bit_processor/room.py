"""The room of the two-level control that the bit processor runs: its four doors under one name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

from heatertune.plc.bit_processor.export import PROGRAM, export_words, from_image
from heatertune.plc.bit_processor.machine import START, State, Wiring, scan
from heatertune.plc.bit_processor.programs import ON_OFF_NAMES
from heatertune.plc.bit_processor.words import COUNTS, FIELDS, TIMER, check_words, encode
from heatertune.plc.room import Room, Scaling, Scan, Timing, Words

__all__ = ["ROOM", "OnOff"]

_OUT: Final = ON_OFF_NAMES.bits["OUT"]
_WIRING: Final = Wiring(results={ON_OFF_NAMES.bits["AC1<AC2"]: -1, ON_OFF_NAMES.bits["AC1>AC2"]: 1})

_INPUTS: Final = {"SP": "INT", "PV": "INT"}

_WIDE: Final = 0.1  # of the sensor range


class _Running(NamedTuple):
    band: int
    state: State


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class OnOff(Room):
    """See `heatertune.plc.room.Room`."""

    def timing(self, words: Words) -> Timing:
        """Return the scan interval; the switch behind the output is an actuator, always on or off for a whole scan."""
        return Timing(scan_s=words.sample_time_s)

    def measure(self, words: Words, temperature_degC: float) -> int:
        """Return the count, cut as a converter does, limited to its range."""
        scaled = (temperature_degC - words.scaling.low_degC) * COUNTS / words.scaling.span_degC
        return int(min(max(scaled, 0.0), COUNTS))

    def start(self, words: Words, switches: Mapping[str, str]) -> _Running:
        """Return the state after power-on: heater off."""
        del switches
        return _Running(words.whole["BAND"], START)

    def step(
        self, words: Words, state: _Running, setpoint: int, reading: int, switches: Mapping[str, str],
        *, cycle_start: bool = True,
    ) -> tuple[_Running, Scan]:
        """Run one scan of the program; the word is in the state since `start`."""
        del words, switches, cycle_start
        after = scan(PROGRAM, _WIRING, state.state, registers=(setpoint, reading, state.band))
        is_on = after.is_on(_OUT)
        flags = {"overflow": after.overflow, "endless": after.endless}
        return state._replace(state=after), Scan(power_pct=100.0 if is_on else 0.0, output=int(is_on), flags=flags)

    def scan(self, state: _Running, inputs: Mapping[str, int]) -> tuple[_Running, Scan]:
        """Run one scan with SP and PV."""
        return self.step(_NO_WORDS, state, inputs["SP"], inputs["PV"], {})


#: the word of a running program is in its state
_NO_WORDS: Final = Words(target="on-off", values={}, scaling=Scaling(), sample_time_s=1.0)

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
    switches=(),
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
    read_image=from_image,
    oddities=_oddities,
)
