"""The exported source in a machine for structured text; the instruction, which is firmware, is the proof's."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, Final, NamedTuple

from heatertune.errors import InputError
from heatertune.plc.cpu.iec.machine import Firmware, TextProgram, Value
from heatertune.plc.cpu.iec.text import units
from heatertune.plc.exported import CallResult, ExportedInPlc
from heatertune.plc.pid_compact.source import BROKEN_HIGH, CALL, LOAD
from heatertune.plc.pid_compact.step import COLD, block_of, scale_input, scan
from heatertune.plc.pid_compact.words import BlockTags
from heatertune.plc.ramp import Number
from heatertune.plc.words import WordField

__all__ = ["LAW", "InstructionLaw", "load_program", "loaders"]

_BODY: Final = r'FUNCTION "{}" : Void\b.*?\nBEGIN\n(.*?)END_FUNCTION'
#: the instance's names: quotation marks and dots, which the machine's names do not have
_TAG: Final = re.compile(r'"(\w+)"((?:\.\w+)*)')
_INSTANCE: Final = "PID"
_SCALING: Final = ("LowerPointIn", "UpperPointIn", "LowerPointOut", "UpperPointOut")


class InstructionLaw(NamedTuple):
    """What the instruction computes: the memory before its first cycle, the block for words, a cycle on all inputs."""

    cold: Any
    block_of: Callable[[Mapping[str, Any], Any], Any]
    scan: Callable[[Any, Any, Mapping[str, Any]], tuple[Any, float, Any, int]]


LAW: Final = InstructionLaw(COLD, block_of, scan)


def _flat(tag: str) -> str:
    return tag.replace(".", "_")


class ExportedPid(ExportedInPlc):
    """See `heatertune.plc.exported.ExportedInPlc`."""

    def __init__(self, text: str, tags: BlockTags, instruction: FirmwareInstruction, cycle_s: float) -> None:
        """Take a source; raise InputError where it is not of the exported form."""
        self._firmware, self._per_call, self._least = instruction, 1, -100.0 if tags.cools else 0.0
        self._program = load_program(text, tags, self._firmware.firmware)
        self.start()
        self._scan(0.0, BROKEN_HIGH)
        tick = float(self._program["PID_TICK"])
        self._tick_s = tick if tick > 0.0 else cycle_s
        self._per_call = max(1, round(cycle_s / self._tick_s))
        self.start()

    @property
    def tick_s(self) -> float:
        """CycleTime.Value, as a person writes it [s]."""
        return float(f"{self._tick_s:.7g}")

    def start(self) -> None:
        """Run the start-up OB on an instance that retained nothing."""
        self._program.start()
        self._firmware.start()
        self._program["Starts"] = True
        self._since = 0

    def call(self, asked: Number, counts: int, reading_degC: float) -> CallResult:  # noqa: ARG002 - of Input_PER
        """Run the tick in which the algorithm is due."""
        self._since = 0
        return self._scan(asked, counts)

    def tick(self, asked: Number, counts: int, reading_degC: float) -> tuple[CallResult, bool | None]:  # noqa: ARG002
        """Run a tick of the cyclic interrupt OB; the pulses are the instruction's own."""
        return self._scan(asked, counts), None

    def interrupt(self) -> tuple[float, bool | None]:
        """Run a tick with a broken wire."""
        made, self._since = self._scan(0.0, 32767), 0
        return made.power_pct, None

    def begin(self, output: Number, ticks: int) -> bool | None:  # noqa: ARG002
        """Return None: the pulses are the instruction's own."""
        return None

    def go_on(self) -> bool:
        """Not reached, see `begin`."""
        raise NotImplementedError

    def tick_count(self) -> float | None:
        """Return None: nothing is counted."""
        return None

    def _scan(self, asked: Number, counts: int) -> CallResult:
        program, self._firmware.due = self._program, self._since % self._per_call == 0
        program["Setpoint"], program["Reading"] = asked, counts
        program.scan()
        program["Starts"] = False
        self._since += 1
        power = program["PID_POWER"]
        return CallResult(program["PID_ASKED"], power, min(max(power, self._least), 100.0))


class FirmwareInstruction:
    """The firmware: its instance DB by flattened names, and a law."""

    def __init__(self, tags: BlockTags, fields: Sequence[WordField], assume: Any, law: InstructionLaw) -> None:
        """Take the block's names and words."""
        self._tags, self._assume, self._fields, self._law = tags, assume, fields, law
        # of the configuration, what the proof takes to be so
        self._sure = {"Config_InputPerOn": True} | ({} if tags.inverts else {"Config_ActivateCooling": tags.cools})
        self.due = True
        self.start()

    def start(self) -> None:
        """Forget all but the instance DB."""
        self._state, self._power = self._law.cold, 0.0
        self._held: dict[str, Value] = {}
        self._block: Any = None

    @property
    def firmware(self) -> Firmware:
        """The block as the machine takes it."""
        tags = self._tags
        kinds = {"Setpoint": "REAL", "Input_PER": "INT", "Reset": "BOOL", "LoadBackUp": "BOOL", "Power": "REAL"}
        kinds |= {_flat(field.address): field.format for field in self._fields}
        kinds |= {_flat(tags.saved(name)): "REAL" for name in tags.parameters}
        kinds |= {_flat(f"Config.InputScaling.{name}"): "REAL" for name in _SCALING}
        kinds |= {_flat(tag): "REAL" for tag in (
            "OverwriteInitialOutputValue", "SubstituteOutput", "CycleTime.Value", "Config.InputLowerLimit",
            "Config.InputUpperLimit", "Config.SetpointLowerLimit", "Config.SetpointUpperLimit",
            tags.config("MinimumOnTime"), tags.config("MinimumOffTime"))}
        kinds |= {_flat(tag): "BOOL" for tag in (
            "ActivateRecoverMode", "SetSubstituteOutput", "Config.InputPerOn", "CycleTime.StartEstimation",
            "CycleTime.EnEstimation", "CycleTime.EnMonitoring")}
        outputs = () if tags.inverts else ("Heat", "Cool") if tags.cools else ("Heat",)
        for side in outputs:
            place, own = f"Config.Output.{side}.", "" if side == "Heat" else side
            kinds |= {"Config_ActivateCooling": "BOOL", _flat(f"{place}Select"): "INT"}
            kinds |= {_flat(tag): "REAL" for tag in (
                tags.active(f"{own}DeadZone"), tags.active(f"{own}ControlZone"),
                *(place + name for name in ("PwmPeriode", "PidUpperLimit", "PidLowerLimit", "MinimumOnTime",
                                            "MinimumOffTime")),
                *(f"{place}{kind}{end}Scaling" for kind in ("", "Pwm") for end in ("Upper", "Lower")))}
        return Firmware(kinds, lambda: self._run)

    def _run(self, given: Mapping[str, Any]) -> dict[str, Value]:
        if wrong := [name for name, value in self._sure.items() if given[name] != value]:
            raise InputError(f"{wrong[0]} is not what was proven")
        if not (self.due or given["Reset"]):
            return {"Power": self._power}
        values = {field.name: given[_flat(field.address)] for field in self._fields}
        if values != self._held:
            self._held, self._block = values, self._law.block_of(values, self._assume)
        low, high = (given[f"Config_InputScaling_{end}PointOut"] for end in ("Lower", "Upper"))
        reading = scale_input(given["Input_PER"], int(given["Config_InputScaling_UpperPointIn"]), low, high)
        inputs = {"Setpoint": min(max(given["Setpoint"], given["Config_SetpointLowerLimit"]),
                                  given["Config_SetpointUpperLimit"]), "Input": reading, "Reset": given["Reset"]}
        self._state, _, self._power, _ = self._law.scan((self._block, self._assume), self._state, inputs)
        return {"Power": self._power}


def load_program(text: str, tags: BlockTags, instruction: Firmware) -> TextProgram:
    """Return a source's two functions as one program: the first where `Starts` is TRUE, the second always.

    Raises:
        InputError: one of them is not there, or holds what the machine does not know.
    """
    bodies = []
    for name in (LOAD, CALL):
        body = re.search(_BODY.format(name), text, re.DOTALL)
        if body is None:
            raise InputError(f'no FUNCTION "{name}"')
        bodies.append(_TAG.sub(lambda tag: _renamed(tag, tags), body[1]).replace("#", ""))
    load, call = bodies
    return TextProgram(units(
        f"PROGRAM Heater\nVAR\n  Starts : BOOL;\n  Setpoint : REAL;\n  Reading : INT;\n  PID_POWER : REAL;\n"
        f"  PID_ASKED : REAL;\n  PID_TICK : REAL;\n  {_INSTANCE} : INSTRUCTION;\nEND_VAR\n"
        f"IF Starts THEN\n{load}END_IF;\n{call}"
        f"PID_POWER := {_INSTANCE}.Power;\nPID_ASKED := {_INSTANCE}.Setpoint;\n"
        f"PID_TICK := {_INSTANCE}.CycleTime_Value;\nEND_PROGRAM\n"), {"INSTRUCTION": instruction})


def _renamed(tag: re.Match[str], tags: BlockTags) -> str:
    if tag[1] != tags.instance:
        raise InputError(f"{tag[0]} is not of {tags.instance}")
    return _INSTANCE + ("." + _flat(tag[2][1:]) if tag[2] else "")


def loaders(
    tags: BlockTags, fields: Sequence[WordField], law: InstructionLaw, files: Mapping[str, str | bytes], assume: Any
) -> dict[str, Callable[[], ExportedPid | None]]:
    """Return what loads the source; the interval of the algorithm is Cycle of its words.

    Args:
        tags: the block's names.
        fields: its words.
        law: what it computes.
        files: of the export.
        assume: what the manual leaves open.
    """
    file = f"{tags.files}_words.scl"

    def load() -> ExportedPid:
        text = str(files[file])
        cycle = re.search(rf"{re.escape(tags.active('Cycle'))} := ([0-9.E+-]+);", text)
        if cycle is None:
            raise InputError(f"{tags.active('Cycle')} is not assigned")
        return ExportedPid(text, tags, FirmwareInstruction(tags, fields, assume, law), float(f"{float(cycle[1]):.7g}"))

    return {file: load}
