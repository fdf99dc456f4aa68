"""Plants small faults in exported programs, one at a time, and asks whether a proof notices: `exported-text`.

    python tests/bench/text_faults.py weg weg_pid_block.st
    python tests/bench/text_faults.py s7-300 s7_300_pid.awl data    the values of its data blocks alone

A fault is an operation turned, a constant or a start value one more, one less or the next REAL, or a statement left out. It counts as noticed
where it is in one of a few runs that show much: a ramp with a holdback, a boost, both limits, an open circuit, a restart. What no run of
a proof shows, or what changes nothing, stands in text_faults.txt with its reason, a line each: file | statement: fault # reason,
numbers being N; a reason holds for all faults of a statement where none is named. Ends with status 1 where another survives.
"""

import re
import sys
from collections import Counter
from dataclasses import replace
from itertools import chain
from pathlib import Path

import numpy as np

from heatertune.model.model_values import Fopdt
from heatertune.pid.design_values import PidDesign, structure_of
from heatertune.plc import Boost, Certificate, Ramp, Scaling, controller_for
from heatertune.plc.pwm import switched_by
from heatertune.proof import Scenario, TemperatureStep, simulate
from heatertune.proof.scenario import Mains, NewSetpoint, PlcPower
from heatertune.proof.text_comparison import compare_text

REASONS = Path(__file__).with_suffix(".txt")
HEATER = Fopdt(gain_degC_per_pct=0.9, time_constant_s=100.0, dead_time_s=2.0, ambient_degC=20.0)
STORY = Scenario(setpoint_degC=51.0, duration_s=1000.0, noise_degC=0.05, disturbances=(
    NewSetpoint(time_s=200.0, setpoint_degC=40.0), TemperatureStep(time_s=450.0, temperature_degC=-6.0),
    Mains(time_s=550.0, share=0.0), Mains(time_s=700.0, share=1.0),
    PlcPower(time_s=850.0, on=False), PlcPower(time_s=880.0, on=True)))
#: full power until so near, and again from so far on: beyond the step, nearer than the open circuit's end
BOOST = Boost(within_degC=4.5, again_degC=9.5)
#: (TN, TV) of the design, ramp, boost or neither, words that are changed, shortest pulse
LOOPS = {
    "weg": [((60.0, 1.5), True, {"TauSetPoint": 2.0, "MaximumOutput": 70.0, "MinimumOutput": 15.0}, 0.06),
            ((60.0, 0.0), False, {"Type": 1, "Ki": 0.0625, "Kd": 4.0}, 0.06), ((float("inf"), 1.5), BOOST, {"MaximumOutput": 90.0}, 0.0)],
    "iec-pid": [((60.0, 1.5), True, {"XMAX": 70.0, "XMIN": 15.0}, 0.06), ((60.0, 0.0), False, {}, 0.06),
                ((float("inf"), 1.5), BOOST, {"XMAX": 90.0}, 0.0)],
    "s7-300": [((60.0, 1.5), True, {}, 0.06), ((60.0, 3.0), False, {}, 0.06), ((float("inf"), 0.0), False, {}, 0.0)],
    "fb41": [((60.0, 3.0), True, {}, 0.06), ((60.0, 0.0), False, {"LMN_HLM": 70.0, "LMN_LLM": 15.0}, 0.06), ((60.0, 3.0), False, {}, 0.0)],
}
#: targets whose last loop is switched by PULSEGEN
GENERATED = ("s7-300", "fb41")
TURNED = {
    "+": "-", "-": "+", "*": "/", "/": "*", "<": "<=", "<=": "<", ">": ">=", ">=": ">", "<>": "=", "=": "<>", "AND": "OR", "OR": "AND",
    "NOT": "", "MOD": "/", "TRUE": "FALSE", "FALSE": "TRUE"}
TURNED_STL = {
    "+R": "-R", "-R": "+R", "*R": "/R", "/R": "*R", "+D": "-D", "-D": "+D", "*D": "+D", "/D": "*D", "+I": "-I", "-I": "+I",
    "MOD": "/D", ">R": ">=R", ">=R": ">R", "<=R": "<R", "<R": "<=R", "<>R": "==R", ">D": ">=D", ">=D": ">D", "<D": "<=D", "<=I": "<I",
    ">I": ">=I", "<I": "<=I", "<>I": "==I", "==I": "<>I", "JC": "JCN", "JCN": "JC", "JOS": "JU", "A": "AN", "AN": "A",
    "SET": "CLR", "CLR": "SET", "S": "R", "R": "S", "RND": "TRUNC", "TRUNC": "RND", "T": "L", "AD": "+D"}
TOKEN = re.compile(r"\(\*.*?\*\)|:=|<>|<=|>=|[-+*/<>=]|\b\d+\.\d+(?:E-?\d+)?|\b\d+\b|\b[A-Za-z_]\w*", re.DOTALL)
TITLE = re.compile(r"^TITLE =([^\r\n]*)", re.MULTILINE)


def loops(target):
    """Words and switches whose runs show much."""
    controller = controller_for(target)
    for (tn, tv), ramped, changed, shortest in LOOPS[target]:
        design = PidDesign(gain_pct_per_degC=5.0, integral_time_s=tn, derivative_time_s=tv, sample_time_s=2.0,
                           structure=structure_of(tn, tv), method="")
        words = controller.encode(design, Scaling(low_degC=0.0, high_degC=150.0))
        words = replace(words, values=dict(words.values) | changed)
        if isinstance(ramped, Boost):
            words = words.with_boost(ramped)
        elif ramped:
            step = controller.ramp(words, 40.0, 3.0)
            words = replace(words, ramp=Ramp(step=step.step, calls=2, hold=step.hold))
        block = "pulsegen" if target in GENERATED and (tn, tv) == LOOPS[target][-1][0] and not shortest else None
        yield words, switched_by(block, pwm_period_s=8.3, minimum_on_s=shortest, minimum_off_s=shortest)


def runs(target):
    """The runs that a fault is shown to."""
    for words, actuator in loops(target):
        yield simulate(controller_for(target), words, HEATER, STORY, actuator)


def text_of(trace, file):
    """The text that is exported after this run."""
    told = Certificate(verdict="PASS", setpoint_degC=trace.setpoint_degC, actuator=trace.actuator)
    return controller_for(trace.words.target).export(trace.words, told)[file]


def departs(trace, file, text):
    """What a proof says of this run where a file of the export holds this text, and the others nothing to compare it with."""
    controller = controller_for(trace.words.target)
    loads = type(controller).load_exported

    class Alone(type(controller), name="alone"):
        load_exported = staticmethod(lambda files, assume: {file: loads(dict(files) | {file: text}, assume)[file]})

    return compare_text(Alone(), trace.words, trace).departs


def faults(file, text, part=""):
    """Yield what was done to which statement, numbers being N, and the text with it.

    `part` is "data" for the values of data blocks alone.
    """
    seen = Counter()
    planted = _in_text(text) if file.endswith(".st") else chain(() if part == "data" else _in_list(text), _in_data(text))
    for place, end, instead, what in planted:
        line = text[text.rfind("\n", 0, place) + 1: text.find("\n", place)].strip()
        line = re.sub(r"\b\d+(\.\d+)?(E-?\d+|e[+-]\d+)?", "N", re.sub(r" *(\(\*|//).*", "", line))
        title = "" if file.endswith(".st") else f"{TITLE.findall(text[:place])[-1]}: "
        named = f"{title}{' '.join(line.split())}: {what}"
        seen[named] += 1
        yield f"{named}{f' ({seen[named]})' if seen[named] > 1 else ''}", text[:place] + instead + text[end:]


def _numbers(digits):
    """Yield (constant, what) that stand in place of a constant."""
    if "." in digits:
        value = np.float32(digits)
        for other, what in ((np.nextafter(value, np.float32(9e9)), "next"), (value + np.float32(1.0), "one more")):
            shown = f"{other:.9e}"
            mantissa, _, power = shown.partition("e")
            yield f"{mantissa}E{int(power)}", what
    else:
        yield str(int(digits) + 1), "one more"
        if int(digits):
            yield str(int(digits) - 1), "one less"


def _in_text(text):
    for token in TOKEN.finditer(text, text.index("VAR")):
        word = token[0]
        if word in TURNED:
            yield token.start(), token.end(), TURNED[word], f"{word} turned"
        elif word[0].isdigit():
            for constant, what in _numbers(word):
                yield token.start(), token.end(), constant, what
    begins = text.index("END_VAR")
    for statement in re.finditer(r"^ *\w[\w.]* := [^;]*;|^ *HeaterPid\([^;]*;|^ *IF [^\n]*\n *[^\n]*;\n *END_IF;", text, re.MULTILINE):
        if statement.start() > begins and "VAR\n" not in statement[0]:
            yield statement.start(), statement.end(), "", "left out"


def _in_list(text):
    for line in re.finditer(r"^(?:\w+:)? +(?P<name>[^\s;:=]+) *(?P<operand>[^;\n(:]*);", text, re.MULTILINE):
        name, operand = line["name"], line["operand"].strip()
        if line.start() < text.index("FUNCTION_BLOCK") or name in ("NOP", "END_STRUCT"):
            continue
        here = line.start("name"), line.end()
        yield *here, "NOP   0;", "left out"
        if name in TURNED_STL:
            yield *here, f"{TURNED_STL[name]}     {operand};", "turned"
        if name == "L" and (constant := re.fullmatch(r"(L#|DW#16#|-?)([\d.A-F]+)(e[+-]\d+)?", operand)):
            digits = str(int(constant[2], 16)) if constant[1] == "DW#16#" else constant[2] + (constant[3] or "")
            for other, what in _numbers(digits):
                shown = f"{int(other):X}" if constant[1] == "DW#16#" else other.replace("E", "e")
                yield *here, f"L     {constant[1]}{shown};", what


def _in_data(text):
    for block in re.finditer(r"^DATA_BLOCK.*?^END_DATA_BLOCK", text, re.MULTILINE | re.DOTALL):
        for value in re.finditer(r"^  \w+ := (?P<kind>L#|T#)?(?P<value>[^;\s]+?)(?P<unit>MS)? ;", block[0], re.MULTILINE):
            here = block.start() + value.start("value"), block.start() + value.end("value")
            if value["value"] in ("TRUE", "FALSE"):
                yield *here, TURNED[value["value"]], f"{value['value']} turned"
            else:
                for other, what in _numbers(value["value"]):
                    yield *here, other.replace("E", "e"), what


def survivors(target, file, every=1, part=""):
    """Return which of the faults, or of each so many one, no run shows, and how many there were."""
    planted = [(trace, dict(faults(file, text_of(trace, file), part))) for trace in runs(target)]
    drawn = set(list(dict.fromkeys(named for _, here in planted for named in here))[::every])
    alive = {}
    for trace, here in planted:
        assert departs(trace, file, text_of(trace, file)) is None
        for named, broken in here.items():
            if named in drawn and alive.get(named, True):
                alive[named] = departs(trace, file, broken) is None
    return [named for named, lives in alive.items() if lives], len(alive)


def reasons(file):
    """Return statement, or statement and fault → why no proof notices it."""
    known = {}
    for line in REASONS.read_text(encoding="utf-8").splitlines():
        told, _, reason = line.partition(" # ")
        name, _, what = told.partition(" | ")
        if file in name.split(", "):
            known[what.strip()] = reason
    return known


def unexplained(target, file, every=1, part=""):
    """Return the survivors without a reason, the reasons without a survivor, and how many faults there were."""
    alive, count = survivors(target, file, every, part)
    known, used, left = reasons(file), set(), []
    for named in alive:
        keys = named, named.rpartition(":")[0], named.partition(": ")[0]
        reason = next((key for key in keys if key in known), None)
        used.add(reason)
        left += [] if reason else [named]
    return left, [] if part else sorted(set(known) - used), count


if __name__ == "__main__":
    found, unused, of = unexplained(*sys.argv[1:3], part="".join(sys.argv[3:]))
    sys.stdout.writelines(f"SURVIVED {named}\n" for named in found)
    sys.stdout.writelines(f"no survivor: {named}\n" for named in unused)
    sys.stdout.write(f"{of} faults, {len(found)} noticed by nobody\n")
    sys.exit(bool(found or unused))
