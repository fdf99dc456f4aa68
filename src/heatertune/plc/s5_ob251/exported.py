"""The exported S5 program, statement by statement in its CPU; OB251 itself, which is firmware, is the proof's."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from heatertune.plc.cpu.s5.machine import Cpu
from heatertune.plc.exported import Called
from heatertune.plc.ramp import Number
from heatertune.plc.s5_ob251.blocks import DB, FOUR_MA, INPUT, MODE, OUTPUT, START, WORK
from heatertune.plc.s5_ob251.step import COLD, FULL_SCALE, REG_AUS, Assumptions, call, percent
from heatertune.plc.s5_ob251.words import FIELDS, parameters_of

__all__ = ["ExportedS5"]

#: of DB31: the setpoint asked for, YA, calls of OB13 until OB251's, and the staircase with its remainder
_ASKED, _YA, _DUE, _STAIRS, _PART = 0, 4, 5, 6, 7
_FAR: Final = 32767
_PLACES: Final = {field.name: int(field.address.removeprefix("DW")) for field in FIELDS}


class ExportedS5:
    """See `heatertune.plc.exported.Exported`."""

    def __init__(self, files: Mapping[str, str | bytes], assume: Assumptions) -> None:
        """Load the files of an export; raise InputError where the listing has what the CPU does not know."""
        self._listing = str(files["program_listing.txt"])
        self._cpu = Cpu(self._listing, {"OB 251": self._ob251})
        self._assume, self._state = assume, COLD
        # a program that leaves what a battery kept begins from cold where there is none
        start = self._listing.partition(f"\nFB {START}\n")[2].partition("\nFB ")[0].partition("\nOB ")[0]
        self._forgets = not assume.retained and "OB 251" not in start
        self._zero = FOUR_MA if f"+{FOUR_MA}; 4 mA" in self._listing else 0
        self._cpu.inputs[MODE] = 1
        self.start()

    def start(self) -> None:
        """Run OB22, with the data blocks as they were, or as they were typed where nothing was kept."""
        if self._forgets:
            self._cpu.data, self._state = Cpu(self._listing, {"OB 251": self._ob251}).data, COLD
        self._cpu.run("OB 22")

    def call(self, asked: Number, counts: int) -> Called:
        """Run OB13 when OB251 is due."""
        work, own = self._cpu.data[WORK], self._cpu.data[DB]
        work[_ASKED], work[_DUE] = int(asked), 1
        self._cpu.inputs[INPUT] = counts + self._zero << 3
        self._cpu.run("OB 13")
        return Called(own[_PLACES["W"]], own[48], percent(own[48]))

    def pulses(self, output: Number, ticks: int) -> int | None:
        """Run OB13 for a period that begins with this YA."""
        if OUTPUT not in self._cpu.outputs:
            return None
        work = self._cpu.data[WORK]
        work[_YA], work[_DUE], work[_STAIRS], work[_PART] = int(output), _FAR, FULL_SCALE, 0
        on = 0
        for _ in range(ticks):
            self._cpu.run("OB 13")
            on += self._cpu.outputs[OUTPUT]
        return on

    def _ob251(self, dw: list[int]) -> None:
        p = parameters_of({name: dw[place] for name, place in _PLACES.items()})
        if p.steu & REG_AUS:
            dw[18:49] = [0] * 31
        self._state = call(p, self._assume, self._state, dw[_PLACES["W"]], dw[22], dw[24], dw[29])
        dw[48] = self._state.output
