"""An exported program of the S7-300, statement by statement in its CPU."""

from __future__ import annotations

from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import ClassVar, Final, final

from heatertune.plc.cpu.s7_300.machine import Cpu, Firmware
from heatertune.plc.cpu.s7_300.program import DATA, PWM_DATA
from heatertune.plc.cpu.s7_300.source import signed
from heatertune.plc.exported import Called
from heatertune.plc.ramp import Number

__all__ = ["ExportedS7"]

_FULLY: Final = 3  # periods that are run tick by tick
_INPUT: Final = 256


class ExportedS7(ABC):
    """See `heatertune.plc.exported.Exported`; of most periods only the ticks on are computed, at their beginning."""

    pulsegen: ClassVar[Mapping[str, Firmware]] = {"FB 43": lambda _cpu, _words: None}

    def __init__(self, source: str, firmware: Mapping[str, Firmware]) -> None:
        """Load a source into a CPU with this firmware; raise InputError where it has what the CPU does not know."""
        self._cpu, self._fully = Cpu(source, {**self.pulsegen, **firmware}), _FULLY
        self._own, self._pwm = self._cpu.members[f"DB {DATA}"], self._cpu.members.get(f"DB {PWM_DATA}")
        self._cpu.memory["L OB 35"][10:12] = self._cpu.get(self._own["TICK_MS"]).to_bytes(2, "big")
        self._cpu.put(self._own["AUTO"], 1)
        self.start()

    @abstractmethod
    def asked(self, counts: int) -> int:
        """Return the setpoint's bits for an analog value."""

    @abstractmethod
    def outcome(self) -> tuple[Number, float]:
        """Return the controller's output, and the power that it stands for [%]."""

    @abstractmethod
    def force(self, output: Number) -> None:
        """Write the controller's output."""

    @final
    def start(self) -> None:
        """Run OB100."""
        self._cpu.run("OB 100")

    @final
    def call(self, asked: Number, counts: int) -> Called:
        """Run OB35 when the controller is due."""
        cpu, own = self._cpu, self._own
        cpu.put(own["SP"], self.asked(int(asked)))
        cpu.put(own["TICKS"], 0)
        cpu.memory["P"][_INPUT : _INPUT + 2] = counts.to_bytes(2, "big")
        cpu.run("OB 35")
        led = own.get("LED")
        return Called(asked if led is None else signed(cpu.get(led), 16), *self.outcome())

    @final
    def pulses(self, output: Number, ticks: int) -> int | None:
        """Run OB35 for a period that begins with this output."""
        cpu = self._cpu
        if self._pwm is None:
            return None
        self.force(output)
        cpu.put(self._pwm["TICK"], 0)
        cpu.put(self._own["TICKS"], 1)
        cpu.run("OB 35")
        if self._fully == 0:
            return cpu.get(self._pwm["COUNT"])
        self._fully -= 1
        on = cpu.memory["P"][4] & 1
        for _ in range(ticks - 1):
            cpu.run("OB 35")
            on += cpu.memory["P"][4] & 1
        return on
