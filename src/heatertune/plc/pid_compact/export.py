"""Words as SCL source, their rollback as SCL source, and a table for a watch table. None was tried in TIA Portal.

The source has a function that sets the words in the instance DB and one that calls the instruction. It runs in the
emulator for structured text; the instruction itself is firmware and uses the model of the proof.
"""

from __future__ import annotations

import csv
import io
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Any, Final, NamedTuple

from heatertune.errors import InputError
from heatertune.plc.cpu.iec.machine import Firmware, TextProgram, Value
from heatertune.plc.cpu.iec.st_syntax import units
from heatertune.plc.cpu.statement_translation import in_ascii
from heatertune.plc.exported import CallResult, ExportedInPlc
from heatertune.plc.keyed_entry import as_typed
from heatertune.plc.pid_compact.step import COLD, block_of, scale_input, scan
from heatertune.plc.pid_compact.words import COUNTS, BlockTags
from heatertune.plc.pwm import Actuator
from heatertune.plc.ramp import Number
from heatertune.plc.single_precision import single
from heatertune.plc.st.program_text import comment
from heatertune.plc.words import Certificate, Scaling, WordField, Words

__all__ = [
    "BROKEN_HIGH", "BROKEN_LOW", "CALL", "COLUMNS", "LAW", "LOAD", "LOOKED_AT", "ROLLBACK", "InstructionLaw",
    "assignments", "call", "export_words", "literal", "load", "load_program", "loaders", "made_by", "rollback",
    "tick_s",
]


LOAD: Final = "HeaterWords"
CALL: Final = "HeaterCall"
ROLLBACK: Final = "HeaterRollback"

#: analog values of the S7-1200/1500 from which on a reading is none: overflow, and underflow of 4 to 20 mA
BROKEN_HIGH: Final = 32512
BROKEN_LOW: Final = -4865
#: numbers in this range are written without an exponent
_LOWEST_PLAIN: Final = 1e-4
_PLAIN: Final = 1e6
#: how far beyond the sensor's range a reading is no error, as a part of it: more than an input's over-range of 18 %
_BEYOND: Final = 0.2
#: control zone that is switched off
_OFF: Final = "3.402822E38"
#: structure of the cooler's output
_COOLER: Final = "Config.Output.Cool."
#: a finer clock than an organization block has
_LEAST_MS: Final = 1.0

Assignment = tuple[str, str, str]

#: tags beside the words that a text read back is held against, in capitals
LOOKED_AT: Final = frozenset(tag.upper() for tag in (
    "OverwriteInitialOutputValue", "ActivateRecoverMode", "SetSubstituteOutput", "SubstituteOutput",
    *(f"Config.InputScaling.{end}Point{side}" for end in ("Lower", "Upper") for side in ("In", "Out")),
    *(f"Config.{what}{end}Limit" for what in ("Input", "Setpoint") for end in ("Lower", "Upper")),
    "Config.Output.Heat.PidLowerLimit", "Config.Output.Cool.PidUpperLimit",
    *(f"Config.Output.{side}.{kind}{end}Scaling" for side in ("Heat", "Cool") for kind in ("", "Pwm")
      for end in ("Lower", "Upper"))))


def literal(value: float) -> str:
    """Return a REAL with nine digits, so that none is another's."""
    text = f"{value:.9g}"
    if value == 0.0 or _LOWEST_PLAIN <= abs(value) < _PLAIN:
        return text if "." in text else f"{text}.0"
    digits, _, exponent = f"{value:.8e}".partition("e")
    digits = digits.rstrip("0")
    return f"{digits}0E{int(exponent)}" if digits.endswith(".") else f"{digits}E{int(exponent)}"


def made_by(tags: BlockTags, words: Words, actuator: Actuator | None) -> str | None:
    """Return why the block's own output of pulses is not the switch of the proof; None: it is."""
    if actuator is None:
        return "no switch is known of the proof"
    period, cycle, tick = actuator.pwm_period_s, words.sample_time_s, 1000.0 * actuator.resolution_s
    clock = actuator.ticks(cycle) is not None and tick >= _LEAST_MS and abs(tick - round(tick)) <= 1e-6
    other = abs(period - cycle) > 1e-9
    problems = (
        (actuator.block != "pid-compact", "another rule was proven"),
        (not clock, "no organization block has its clock"),
        (other and tags.inverts, f"its period is not Cycle, {cycle:g} s"),
        (other and period > cycle, f"its period is above Cycle, {cycle:g} s"),
        (words.values["OutputLowerLimit"] < 0.0 and not tags.cools, "it knows no output below 0 %"),
        (max(actuator.minimum_on_s, actuator.minimum_off_s, *actuator.cooling_minimum_s) >= period,
         "its shortest times fill the period"),
    )
    return next((why for holds, why in problems if holds), None)


def assignments(tags: BlockTags, words: Words, actuator: Actuator | None) -> Iterator[Assignment]:
    """Yield tag, value and meaning of all that is configured beside the parameters."""
    v = words.values
    lower, upper = literal(0.0 if tags.cools else v["OutputLowerLimit"]), literal(v["OutputUpperLimit"])
    yield tags.config(tags.upper), upper, "%"
    yield tags.config(tags.lower), lower, "%"
    if tags.inverts:
        yield "Config.InvertControl", "TRUE" if v["InvertControl"] else "FALSE", "TRUE: a cooler"
    else:
        if not tags.cools:
            yield "Config.ActivateCooling", "FALSE", "OutputCool stays 0"
        yield tags.active("DeadZone"), "0.0", "off"
        yield tags.active("ControlZone"), _OFF, "off"
        yield from ((tags.config(f"{kind}{end}Scaling"), at, "%") for kind in ("", "Pwm")
                    for end, at in (("Upper", upper), ("Lower", lower)))
    if tags.cools:
        yield from _cooling(tags, words)
    yield "IntegralResetMode", str(v["IntegralResetMode"]), "I part when automatic begins"
    yield "OverwriteInitialOutputValue", "0.0", "%, of IntegralResetMode 3"
    yield from _safe(v["OutputLowerLimit"], v["OutputUpperLimit"])
    yield from _input(words.scaling)
    yield from _clock(tags, words, actuator)


def _cooling(tags: BlockTags, words: Words) -> Iterator[Assignment]:
    v = words.values
    yield "Config.ActivateCooling", "TRUE", "what is below 0 goes to OutputCool"
    yield "Config.AdvancedCooling", "TRUE" if v["AdvancedCooling"] else "FALSE", "FALSE: heating's set and CoolFactor"
    yield "Config.CoolFactor", literal(v["CoolFactor"]), "gain of the heater over the gain of the cooler"
    yield f"{_COOLER}PidUpperLimit", "0.0", "%"
    yield f"{_COOLER}PidLowerLimit", literal(v["OutputLowerLimit"]), "%"
    yield tags.active("CoolDeadZone"), "0.0", "off"
    yield tags.active("CoolControlZone"), _OFF, "off"
    yield from ((f"{_COOLER}{kind}{end}Scaling", at, "%") for kind in ("", "Pwm")
                for end, at in (("Upper", literal(-v["OutputLowerLimit"])), ("Lower", "0.0")))


def _safe(lower: float, upper: float) -> Iterator[Assignment]:
    yield "ActivateRecoverMode", "TRUE", "an error that passes does not end automatic"
    yield "SetSubstituteOutput", "TRUE", "while there is an error the output is SubstituteOutput"
    yield "SubstituteOutput", literal(min(max(0.0, lower), upper)), "%"


def _input(scaling: Scaling) -> Iterator[Assignment]:
    low, high = single(scaling.low_degC), single(scaling.high_degC)
    beyond = _BEYOND * scaling.span_degC
    yield "Config.InputPerOn", "TRUE", "the reading is Input_PER"
    yield "Config.InputScaling.LowerPointIn", "0.0", "analog value"
    yield "Config.InputScaling.UpperPointIn", literal(COUNTS), "analog value"
    yield "Config.InputScaling.LowerPointOut", literal(low), "degC"
    yield "Config.InputScaling.UpperPointOut", literal(high), "degC"
    yield "Config.InputLowerLimit", literal(single(low - beyond)), "degC"
    yield "Config.InputUpperLimit", literal(single(high + beyond)), "degC"
    yield "Config.SetpointLowerLimit", literal(low), "degC"
    yield "Config.SetpointUpperLimit", literal(high), "degC"


def _clock(tags: BlockTags, words: Words, actuator: Actuator | None) -> Iterator[Assignment]:
    """Yield the interval of the calls, and the PWM that was proven where the block makes it."""
    if actuator is not None:
        yield "CycleTime.StartEstimation", "FALSE", "the interval of the calls is told, not measured"
        yield "CycleTime.EnEstimation", "FALSE", "the interval of the calls is told, not measured"
        yield "CycleTime.EnMonitoring", "TRUE", "error 0800h where it is another"
        yield "CycleTime.Value", literal(single(tick_s(tags, words, actuator))), "s, of the cyclic interrupt OB"
    if actuator is None or made_by(tags, words, actuator) is not None:
        return
    if not tags.inverts:
        own = abs(actuator.pwm_period_s - words.sample_time_s) > 1e-9
        period = literal(single(actuator.pwm_period_s)) if own else "0.0"
        yield tags.config("Select"), "1", "OutputHeat and OutputHeat_PWM"
        yield tags.config("PwmPeriode"), period, "s; 0: Cycle"
    yield tags.config("MinimumOnTime"), literal(single(actuator.minimum_on_s)), "s"
    yield tags.config("MinimumOffTime"), literal(single(actuator.minimum_off_s)), "s"
    if tags.cools:
        yield f"{_COOLER}Select", "1", "OutputCool and OutputCool_PWM"
        yield f"{_COOLER}PwmPeriode", period, "s; 0: Cycle"
        for name, time in zip(("MinimumOnTime", "MinimumOffTime"), actuator.cooling_minimum_s, strict=True):
            yield f"{_COOLER}{name}", literal(single(time)), "s"


def tick_s(tags: BlockTags, words: Words, actuator: Actuator) -> float:
    """Return the interval of the cyclic interrupt OB [s]: a step of the PWM, or Cycle where the block makes none."""
    return actuator.resolution_s if made_by(tags, words, actuator) is None else words.sample_time_s


def load(tags: BlockTags, words: Words, actuator: Actuator | None) -> str:
    """Return the function that gives the instance DB its words; it saves those of before, where they are others."""
    at = f'"{tags.instance}".'
    values = {name: literal(words.values[name]) for name in tags.parameters}
    same = " AND\n    ".join(f"{at}{tags.active(name)} = {value}" for name, value in values.items())
    saved = "".join(f"  {at}{tags.saved(name)} := {at}{tags.active(name)};\n" for name in tags.parameters)
    new = "".join(f"{at}{tags.active(name)} := {value};\n" for name, value in values.items())
    rest = "".join(f"{at}{tag} := {value}; (* {meaning} *)\n" for tag, value, meaning in assignments(
        tags, words, actuator))
    return _function(LOAD, "", f"IF NOT ({same}) THEN\n{saved}END_IF;\n{new}{rest}")


def call(tags: BlockTags) -> str:
    """Return the function that the cyclic interrupt OB calls; a broken sensor resets the instruction."""
    inputs = "VAR_INPUT\n  Setpoint : REAL; (* degC *)\n  Reading : INT; (* analog input *)\nEND_VAR\n"
    return _function(CALL, inputs, (
        f'"{tags.instance}"(Setpoint := #Setpoint, Input_PER := #Reading,\n'
        f"  Reset := (#Reading >= {BROKEN_HIGH}) OR (#Reading <= {BROKEN_LOW}));\n"))


def rollback(tags: BlockTags) -> str:
    """Return the function that loads the parameters of before."""
    return _function(ROLLBACK, "", f'"{tags.instance}".LoadBackUp := TRUE;\n')


def _function(name: str, declared: str, body: str) -> str:
    optimized = "{ S7_Optimized_Access := 'TRUE' }"
    return f'FUNCTION "{name}" : Void\n{optimized}\nVERSION : 0.1\n{declared}BEGIN\n{body}END_FUNCTION\n'


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

    def call(self, target: Number, counts: int, reading_degC: float) -> CallResult:  # noqa: ARG002 - of Input_PER
        """Run the tick in which the algorithm is due."""
        self._since = 0
        return self._scan(target, counts)

    def tick(self, target: Number, counts: int, reading_degC: float) -> tuple[CallResult, bool | None]:  # noqa: ARG002
        """Run a tick of the cyclic interrupt OB; the pulses are the instruction's own."""
        return self._scan(target, counts), None

    def interrupt(self) -> tuple[float, bool | None]:
        """Run a tick with a broken wire."""
        result, self._since = self._scan(0.0, 32767), 0
        return result.power_pct, None

    def begin(self, output: Number, ticks: int) -> bool | None:  # noqa: ARG002
        """Return None: the pulses are the instruction's own."""
        return None

    def go_on(self) -> bool:
        """Not reached, see `begin`."""
        raise NotImplementedError

    def tick_count(self) -> float | None:
        """Return None: nothing is counted."""
        return None

    def _scan(self, target: Number, counts: int) -> CallResult:
        program, self._firmware.due = self._program, self._since % self._per_call == 0
        program["Setpoint"], program["Reading"] = target, counts
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

    def _run(self, signals: Mapping[str, Any]) -> dict[str, Value]:
        if wrong := [name for name, value in self._sure.items() if signals[name] != value]:
            raise InputError(f"{wrong[0]} is not what was proven")
        if not (self.due or signals["Reset"]):
            return {"Power": self._power}
        values = {field.name: signals[_flat(field.address)] for field in self._fields}
        if values != self._held:
            self._held, self._block = values, self._law.block_of(values, self._assume)
        low, high = (signals[f"Config_InputScaling_{end}PointOut"] for end in ("Lower", "Upper"))
        reading = scale_input(signals["Input_PER"], int(signals["Config_InputScaling_UpperPointIn"]), low, high)
        inputs = {"Setpoint": min(max(signals["Setpoint"], signals["Config_SetpointLowerLimit"]),
                                  signals["Config_SetpointUpperLimit"]), "Input": reading, "Reset": signals["Reset"]}
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
    """Return the function that loads the source; the interval of the algorithm is Cycle of its words.

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


#: of a watch table, in the order of its editor
COLUMNS: Final = ("Name", "Address", "Display format", "Monitor value", "Modify value", "Comment")


def export_words(
    tags: BlockTags, fields: Sequence[WordField], words: Words, certificate: Certificate
) -> dict[str, str | bytes]:
    """Return the three files; the same words and certificate give the same bytes."""
    head = comment(*_head(tags, words, certificate), *_by_hand(tags, words, certificate))
    short = comment(*_rollback(certificate))
    return {f"{tags.files}_words.scl": f"{head}{load(tags, words, certificate.actuator)}\n{call(tags)}",
            f"{tags.files}_rollback.scl": short + rollback(tags),
            f"{tags.files}_watch.csv": _watch(tags, fields, words, certificate)}


def _head(tags: BlockTags, words: Words, certificate: Certificate) -> tuple[str, ...]:
    scale = words.scaling
    return (
        f"heater controller: words of {tags.block} (S7-1200/1500), V2 and later, for the instance DB {tags.instance}",
        f"sensor {scale.low_degC:g}...{scale.high_degC:g} degC; TA: Cycle = {words.sample_time_s:g} s; {tags.power}"
        f"{f' and {tags.cooler}' if tags.cools else ''} in percent",
        *certificate.head,
        "not tried in TIA Portal",
    )


def _by_hand(tags: BlockTags, words: Words, certificate: Certificate) -> list[str]:
    """Return the remaining manual steps, numbered."""
    actuator = certificate.actuator
    why = made_by(tags, words, actuator)
    interval = words.sample_time_s if actuator is None else tick_s(tags, words, actuator)
    cooler = (f" and {tags.cooler}_PWM to the cooler's", f" and {tags.cooler}") if tags.cools else ("", "")
    wired = (f"wire {tags.pulses} to the heater's switch{cooler[0]}" if why is None else
             f"wire {tags.power}{cooler[1]} through a PWM of yours as it was proven; {tags.pulses} is not it: {why}")
    proven = certificate.setpoint_degC
    steps = (
        f"create the technology object {tags.block}, named {tags.instance} (or change the name here), and generate the "
        "blocks of this external source",
        f"call {LOAD} in a start-up OB (OB 100): each start-up then has these words, whatever was retained; "
        f"{tags.saved('Gain')} and its neighbours keep the ones of before",
        f"call {CALL} in a cyclic interrupt OB every {1000.0 * interval:g} ms, with your setpoint in degC and your "
        "analog input",
        wired,
        "setpoint: " + ("another one than the proven one is not proven" if proven is None else
                        f"{proven:g} degC as proven; another one is not proven"),
        "the mode is yours: Mode = 4 and ManualValue first, then Mode = 3 (automatic) with an edge of ModeActivate; "
        "Mode is retentive and comes back at start-up",
    )
    return ["remains to be done by hand:", *(f"  {number}. {step}" for number, step in enumerate(steps, start=1))]


def _rollback(certificate: Certificate) -> tuple[str, ...]:
    return (
        f"back to the parameters of before: call {ROLLBACK} once, and take {LOAD} out of the start-up OB, which would "
        "load the new ones again",
        "LoadBackUp copies CtrlParamsBackUp to Retain.CtrlParams and falls back to FALSE by itself; "
        f"{LOAD} or the last tuning filled it",
        "limits and other configuration stay as they are",
        *certificate.head[:1],
        "not tried in TIA Portal",
    )


def _watch(tags: BlockTags, fields: Sequence[WordField], words: Words, certificate: Certificate) -> str:
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    notes = (*_head(tags, words, certificate),
             "columns as the editor of a watch table has them, for copying; its own files are no CSV",
             "write the parameters in inactive mode only (Mode = 0)")
    for note in notes:
        table.writerow([f"// {note}"])
    table.writerow(COLUMNS)

    def row(tag: str, form: str, value: str, comment: str) -> None:
        table.writerow([f'"{tags.instance}".{tag}', "", form, "", value, comment])

    for field in fields:
        if field.name in tags.parameters:
            row(field.address, _format(field.format), as_typed(words.values[field.name], field.format), field.comment)
    for tag, value, meaning in assignments(tags, words, certificate.actuator):
        row(tag, "Bool" if value in ("TRUE", "FALSE") else "Floating-point number" if "." in value else "DEC+/-",
            value, meaning)
    row("LoadBackUp", "Bool", "", "TRUE loads CtrlParamsBackUp, the parameters of before")
    return in_ascii(text.getvalue())


def _format(format_: str) -> str:
    return {"REAL": "Floating-point number", "BOOL": "Bool"}.get(format_, "DEC+/-")
