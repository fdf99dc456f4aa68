"""An exported program of the S7-300, statement by statement in its CPU."""

from __future__ import annotations

import math
from abc import abstractmethod
from collections.abc import Mapping
from typing import Final, cast, final

from heatertune.errors import InputError
from heatertune.plc.cpu.s7_300.machine import Firmware, S7300Cpu, clamp
from heatertune.plc.cpu.s7_300.program import DATA, PWM_DATA
from heatertune.plc.cpu.s7_300.source import as_real, signed_number
from heatertune.plc.exported import CallResult, ExportedInPlc
from heatertune.plc.pwm import on_time, pulsegen
from heatertune.plc.ramp import Number

__all__ = ["ExportedS7"]

_OWN: Final = f"DB {DATA}"
_PWM: Final = f"DB {PWM_DATA}"
_TOLD: Final = "L OB 35"
_GENERATOR: Final = "DB 43"
_INPUT: Final = 256
_BROKEN: Final = (0x7FFF, 0x8000)  # overflow, underflow


class _Pulsegen:
    """FB43, which comes with STEP 7, as the proof has it: `heatertune.plc.pwm.pulsegen`."""

    def __init__(self) -> None:
        self.calls, self.on = 0, 0

    def __call__(self, _cpu: S7300Cpu, words: dict[str, int]) -> None:
        """Make the output of one call."""
        if words.get("COM_RST", 0):
            self.calls = 0
            return
        if missing := [name for name in ("PER_TM", "CYCLE", "P_B_TM", "INV") if name not in words]:
            raise InputError(f"FB 43: nobody gives {missing[0]}")
        if other := [name for name in ("STEP3_ON", "ST2BI_ON", "SYN_ON") if words.get(name, 1)]:
            raise InputError(f"FB 43: {other[0]} is TRUE; that is another way to make pulses than was proven")
        period, interval, shortest = (words[name] / 1000.0 for name in ("PER_TM", "CYCLE", "P_B_TM"))
        if self.calls == 0:
            switch = pulsegen(pwm_period_s=period, call_interval_s=interval, minimum_s=shortest)
            self.on = round(on_time(clamp(as_real(words["INV"]), 0.0, 100.0), 0.0, switch.numbers)[0] / interval)
        words["QPOS_P"] = self.calls < self.on
        self.calls = (self.calls + 1) % round(period / interval)


class ExportedS7(ExportedInPlc):
    """See `heatertune.plc.exported.ExportedInPlc`."""

    def __init__(self, source: str, firmware: Mapping[str, Firmware]) -> None:
        """Load a source into a CPU with this firmware; raise InputError where it has what the CPU does not know."""
        self._pulsegen = _Pulsegen()
        self._cpu = cpu = S7300Cpu(source, {"FB 43": self._pulsegen, **firmware})
        self._due, self._setpoint = cpu.member(_OWN, "TICKS"), cpu.member(_OWN, "SP")
        self._led = cpu.members[_OWN].get("LED")
        self._pwm = None if _PWM not in cpu.members else (cpu.member(_PWM, "TICK"), cpu.member(_PWM, "COUNT"))
        self._switches = self._pwm is not None or _GENERATOR in cpu.words
        self._tick_ms = cpu.get(cpu.member(_OWN, "TICK_MS"))
        self._asked: Number | None = None
        if _TOLD not in cpu.memory:
            raise InputError("OB 35: the source has no such block")
        cpu.memory[_TOLD][10:12] = self._tick_ms.to_bytes(2, "big")
        automatic = cpu.member(_OWN, "AUTO")
        if cpu.get(automatic):
            raise InputError(f"{_OWN}: AUTO is TRUE after loading, so it heats before anyone asks for it")
        cpu.put(automatic, 1)
        self.start()

    @abstractmethod
    def setpoint_bits(self, counts: int) -> int:
        """Return the setpoint's bits for an analog value."""

    @abstractmethod
    def outcome(self) -> tuple[Number, float]:
        """Return the controller's output, and the power that it stands for [%]."""

    @abstractmethod
    def force(self, output: Number) -> None:
        """Write the controller's output."""

    @property
    def tick_s(self) -> float:
        """TICK_MS, which OB35 compares with its own interval [s]."""
        return self._tick_ms / 1000.0

    @final
    def start(self) -> None:
        """Run OB100."""
        self._cpu.run("OB 100")
        self._begun = False

    @final
    def call(self, target: Number, counts: int, reading_degC: float) -> CallResult:
        """Run OB35 when the controller is due."""
        if self._begun:
            self._cpu.put(self._due, 0)
        return self.tick(target, counts, reading_degC)[0]

    @final
    def tick(self, target: Number, counts: int, reading_degC: float) -> tuple[CallResult, bool | None]:  # noqa: ARG002
        """Run OB35."""
        cpu = self._cpu
        if self._asked not in (None, target):
            cpu.put(self._setpoint, self.setpoint_bits(int(target)))
        self._asked, self._begun = target, True
        cpu.memory["P"][_INPUT : _INPUT + 2] = counts.to_bytes(2, "big")
        cpu.run("OB 35")
        return CallResult(self._followed(), *self.outcome()), self._on() if self._switches else None

    def _followed(self) -> Number:
        if self._led is not None:
            return signed_number(self._cpu.get(self._led), 16)
        as_asked = self._asked is not None and self._cpu.get(self._setpoint) == self.setpoint_bits(int(self._asked))
        return cast("Number", self._asked) if as_asked else math.nan

    @final
    def interrupt(self) -> tuple[float, bool | None]:
        """Run OB35 with each analog value of a broken wire."""
        self._begun, power_pct, on = False, 0.0, False
        whole = bytes(self._cpu.memory["P"][_INPUT : _INPUT + 2])
        for value in _BROKEN:
            self._cpu.memory["P"][_INPUT : _INPUT + 2] = value.to_bytes(2, "big")
            self._cpu.run("OB 35")
            power_pct, on = max(power_pct, self.outcome()[1]), on or self._on()
        self._cpu.memory["P"][_INPUT : _INPUT + 2] = whole
        return power_pct, on if self._switches else None

    @final
    def begin(self, output: Number, ticks: int) -> bool | None:
        """Run OB35 where a period begins with this output."""
        if not self._switches:
            return None
        self.force(output)
        if self._pwm is None:
            self._pulsegen.calls = 0
        else:
            begins, counted = self._pwm
            self._cpu.put(begins, 0)
            self._cpu.put(counted, ticks + 1)  # anything else than what it has to become
        self._cpu.put(self._due, 1)
        return self.go_on()

    @final
    def go_on(self) -> bool:
        """Run OB35."""
        self._cpu.run("OB 35")
        return self._on()

    @final
    def tick_count(self) -> int | None:
        """Return COUNT, or what PULSEGEN counted."""
        if self._pwm is not None:
            return self._cpu.get(self._pwm[1])
        return self._pulsegen.on if self._switches else None

    def _on(self) -> bool:
        return bool(self._cpu.memory["P"][4] & 1)
