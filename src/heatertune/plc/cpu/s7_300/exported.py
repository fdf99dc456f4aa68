"""An exported program of the S7-300, statement by statement in its CPU."""

from __future__ import annotations

import math
from abc import ABC, abstractmethod
from collections.abc import Mapping
from typing import ClassVar, Final, cast, final

from heatertune.errors import InputError
from heatertune.plc.cpu.s7_300.machine import Cpu, Firmware
from heatertune.plc.cpu.s7_300.program import DATA, PWM_DATA
from heatertune.plc.cpu.s7_300.source import signed
from heatertune.plc.exported import Called
from heatertune.plc.ramp import Number

__all__ = ["ExportedS7"]

_OWN: Final = f"DB {DATA}"
_PWM: Final = f"DB {PWM_DATA}"
_TOLD: Final = "L OB 35"
_INPUT: Final = 256


class ExportedS7(ABC):
    """See `heatertune.plc.exported.Exported`."""

    pulsegen: ClassVar[Mapping[str, Firmware]] = {"FB 43": lambda _cpu, _words: None}

    def __init__(self, source: str, firmware: Mapping[str, Firmware]) -> None:
        """Load a source into a CPU with this firmware; raise InputError where it has what the CPU does not know."""
        self._cpu = cpu = Cpu(source, {**self.pulsegen, **firmware})
        self._due, self._setpoint = cpu.member(_OWN, "TICKS"), cpu.member(_OWN, "SP")
        self._led = cpu.members[_OWN].get("LED")
        self._pwm = None if _PWM not in cpu.members else (cpu.member(_PWM, "TICK"), cpu.member(_PWM, "COUNT"))
        self._tick_ms = cpu.get(cpu.member(_OWN, "TICK_MS"))
        self._asked: Number | None = None
        if _TOLD not in cpu.memory:
            raise InputError("OB 35: the source has no such block")
        cpu.memory[_TOLD][10:12] = self._tick_ms.to_bytes(2, "big")
        cpu.put(cpu.member(_OWN, "AUTO"), 1)
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
    def call(self, asked: Number, counts: int, _reading_degC: float) -> Called:
        """Run OB35 when the controller is due."""
        cpu = self._cpu
        if self._asked not in (None, asked):
            cpu.put(self._setpoint, self.asked(int(asked)))
        self._asked = asked
        cpu.put(self._due, 0)
        cpu.memory["P"][_INPUT : _INPUT + 2] = counts.to_bytes(2, "big")
        cpu.run("OB 35")
        return Called(self._followed(), *self.outcome())

    def _followed(self) -> Number:
        if self._led is not None:
            return signed(self._cpu.get(self._led), 16)
        as_asked = self._asked is not None and self._cpu.get(self._setpoint) == self.asked(int(self._asked))
        return cast("Number", self._asked) if as_asked else math.nan

    @final
    def interval_s(self, most: int) -> float | None:
        """Run OB35 from one call of the controller to the next."""
        self._cpu.put(self._due, 0)
        for ticks in range(1, most + 1):
            self._cpu.run("OB 35")
            if self._cpu.get(self._due) == 0:
                return ticks * self._tick_ms / 1000.0
        return None

    @final
    def begin(self, output: Number, ticks: int) -> bool | None:  # noqa: ARG002 - TICK 0 begins a period
        """Run OB35 where a period begins with this output."""
        if self._pwm is None:
            return None
        self.force(output)
        self._cpu.put(self._pwm[0], 0)
        self._cpu.put(self._due, 1)
        return self.tick()

    @final
    def tick(self) -> bool:
        """Run OB35."""
        self._cpu.run("OB 35")
        return bool(self._cpu.memory["P"][4] & 1)

    @final
    def counted(self) -> int | None:
        """Return COUNT."""
        return None if self._pwm is None else self._cpu.get(self._pwm[1])
