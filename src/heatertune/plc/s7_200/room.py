"""The room of the paper's program: its four doors under one name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

from heatertune.pid.values import PidDesign
from heatertune.plc.room import Certificate, Scaling, Scan, Switch, Timing, WordField, Words
from heatertune.plc.s7_200.export import export_words
from heatertune.plc.s7_200.program import Constants, Memory, printed_scan, repaired_scan
from heatertune.plc.s7_200.words import COUNTS, FIELDS, TIMER, check_words, decode, encode

__all__ = ["ROOM", "S7200"]

#: scans of the printed program per PWM cycle; real ones are more, which changes nothing between two readings
_SCANS_PER_CYCLE = 5

_SWITCHES: Final = (
    Switch(name="width_applies", settings=("this_cycle", "next_cycle"), default="this_cycle",
           why="whether a width written at the rising edge shapes the running PWM cycle or the one after"),
    Switch(name="overflow", settings=("keep", "wrap"), default="keep",
           why="whether an overflowing +I or -I of the CPU 214 leaves its operand or writes the wrapped result"),
    Switch(name="rails", settings=("edges_stop", "edges_go_on"), default="edges_stop",
           why="whether a width of 0 or of the whole cycle still gives the edge that updates the width"),
)


_INPUTS: Final = {"SP": "BYTE", "PV": "BYTE", "CYCLE_START": "BOOL"}

#: the words of a running program are in its state
_NO_WORDS: Final = Words(target="s7-200", values={}, scaling=Scaling(), sample_time_s=1.0)


class _Running(NamedTuple):
    constants: Constants
    printed: bool
    memory: Memory


@dataclass(frozen=True, slots=True)
class S7200:
    """See `heatertune.plc.room.Room`."""

    name: str = "s7-200"
    title: str = "SIMATIC S7-200 CPU 214, PID/PWM program (Alia, Am. J. Appl. Sci. 4(5), 2007, Table 2)"
    fields: tuple[WordField, ...] = FIELDS
    switches: tuple[Switch, ...] = _SWITCHES
    can: tuple[str, ...] = ("PI in whole numbers, its own PWM on Q0.0 of 0.1 to 32.767 s",)
    cannot: tuple[str, ...] = ("no derivative action: the program has no second difference", "8-bit readings")
    sample_times_s: tuple[float, float, float] = TIMER
    counts: int = COUNTS

    def encode(self, design: PidDesign, scaling: Scaling) -> Words:
        """Round the design to the repaired program's constants, once; see `words.encode`."""
        return encode(design, scaling)

    def decode(self, words: Words) -> PidDesign:
        """Return the design as the constants realise it."""
        return decode(words)

    def check(self, words: Words) -> None:
        """Raise OutOfRange for the first constant that the program cannot hold."""
        check_words(words)

    def timing(self, words: Words) -> Timing:
        """Return the scan interval and the PWM cycle; the repaired program computes once per cycle."""
        cycle = words.whole["CYCLE"] / 1000.0
        return Timing(scan_s=cycle / _SCANS_PER_CYCLE if words.whole["PRINTED"] else cycle, pwm_period_s=cycle)

    def measure(self, words: Words, temperature_degC: float) -> int:
        """Return the count of the 8-bit input, cut as a converter does, limited to its range."""
        scaled = (temperature_degC - words.scaling.low_degC) * COUNTS / words.scaling.span_degC
        return int(min(max(scaled, 0.0), COUNTS))

    def start(self, words: Words, switches: Mapping[str, str]) -> _Running:
        """Return the state before the first scan: all words 0."""
        v = words.whole
        constants = Constants(
            kp=v["KP"], ki=v["KI"], kd=v["KD"], t=v["T"], cycle_ms=v["CYCLE"], scale_bits=v["SCALE"], pot1=v["POT1"],
            wrap=switches.get("overflow") == "wrap", next_cycle=switches.get("width_applies") == "next_cycle",
            stops_at_rails=switches.get("rails") != "edges_go_on",
        )
        return _Running(constants, bool(v["PRINTED"]), Memory())

    def step(
        self, words: Words, state: _Running, setpoint: int, reading: int, switches: Mapping[str, str],
        *, cycle_start: bool = True,
    ) -> tuple[_Running, Scan]:
        """Run one scan of the program; words and switches are in the state since `start`."""
        del words, switches
        if state.printed:
            memory = printed_scan(state.constants, state.memory, setpoint, reading, cycle_start)
        else:
            memory = repaired_scan(state.constants, state.memory, setpoint, reading)
        flags = {"SM1.1": memory.overflow, "SM1.3": memory.zero_division}
        power = 100.0 * memory.applied / state.constants.cycle_ms
        return state._replace(memory=memory), Scan(power_pct=power, output=memory.applied, flags=flags)

    def scan(self, state: _Running, inputs: Mapping[str, int]) -> tuple[_Running, Scan]:
        """Run one scan with SP, PV and, where named, whether a PWM cycle begins (the repaired program: always)."""
        begins = bool(inputs.get("CYCLE_START", 1))
        return self.step(_NO_WORDS, state, inputs["SP"], inputs["PV"], {}, cycle_start=begins)

    @property
    def inputs(self) -> Mapping[str, str]:
        """SP and PV in counts; whether a PWM cycle begins with the scan."""
        return _INPUTS

    def export(self, words: Words, certificate: Certificate) -> dict[str, str | bytes]:
        """Return the constants as data-block text and an initialising subroutine."""
        return {**export_words(words, certificate)}


ROOM: Final = S7200()
