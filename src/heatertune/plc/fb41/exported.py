"""The exported program around CONT_C in its CPU; CONT_C itself, which comes with STEP 7, is the proof's."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from typing import Final

from heatertune.errors import InputError
from heatertune.plc.cpu.s7_300.exported import ExportedS7
from heatertune.plc.cpu.s7_300.machine import S7300Cpu
from heatertune.plc.cpu.s7_300.real import clamp
from heatertune.plc.cpu.s7_300.source import as_real, bits_of, signed_number
from heatertune.plc.fb41.step import ContCAssumptions, ContCState, scale_reading, scan
from heatertune.plc.fb41.words import FIELDS, parameters_of
from heatertune.plc.ramp import Number

__all__ = ["loaders"]

_FILE: Final = "fb41_cont_c.awl"
_LMN: Final = slice(72, 76)
_REALS: Final = frozenset(field.name for field in FIELDS if field.format == "REAL")


class ExportedContC(ExportedS7):
    """See `heatertune.plc.exported.ExportedInPlc`."""

    def __init__(self, source: str, assume: ContCAssumptions) -> None:
        """Load a source; raise InputError where the source has what the CPU does not know."""
        self._assume, self._state = assume, ContCState()
        self._held: tuple[int, ...] = ()
        super().__init__(source, {"FB 41": self._cont_c})

    def setpoint_bits(self, counts: int) -> int:
        """Return an analog value, which a ramp takes, or what it means in the unit of PV."""
        if self._led is not None:
            return counts
        return bits_of(scale_reading(parameters_of(_values(self._cpu.words["DB 41"])), counts)[0])

    def outcome(self) -> tuple[Number, float]:
        """Return LMN, and it within 0…100 %."""
        lmn = as_real(int.from_bytes(self._cpu.memory["DB 41"][_LMN], "big"))
        return lmn, clamp(lmn, 0.0, 100.0)

    def force(self, output: Number) -> None:
        """Write LMN."""
        self._cpu.memory["DB 41"][_LMN] = bits_of(output).to_bytes(4, "big")

    def _cont_c(self, _cpu: S7300Cpu, words: dict[str, int]) -> None:
        if not words["PVPER_ON"]:
            raise InputError("FB 41: PVPER_ON is FALSE; so it reads PV_IN, and no analog value")
        values = tuple(words[field.name] for field in FIELDS)
        if values != self._held:
            self._held, self._parameters = values, parameters_of(_values(words))
        inputs = {"COM_RST": words["COM_RST"], "MAN_ON": words["MAN_ON"],
                  "PV_PER": signed_number(words.get("PV_PER", 0), 16),
                  "SP_INT": as_real(words.get("SP_INT", 0))}
        self._state, _, lmn, _ = scan((self._parameters, self._assume), self._state, inputs)
        self.force(lmn)


def _values(words: Mapping[str, int]) -> dict[str, Number]:
    return {field.name: as_real(words[field.name]) if field.name in _REALS else words[field.name] for field in FIELDS}


def loaders(files: Mapping[str, str | bytes], assume: ContCAssumptions) -> dict[str, Callable[[], ExportedContC]]:
    """Return what loads the source."""
    return {_FILE: lambda: ExportedContC(str(files[_FILE]), assume)}
