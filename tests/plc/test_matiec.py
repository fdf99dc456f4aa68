"""matiec, the compiler of OpenPLC and Beremiz, takes every structured text and every PLCopen project that is exported.

It runs where `iec2c` is on the path; its library is the folder that MATIEC_LIB names, or the one beside the program.
"""

import math
import os
import random
import re
import shutil
import struct
import subprocess
from pathlib import Path
from xml.etree import ElementTree

import numpy as np
import pytest
from tests.plc.export_corpus import controller_exports, every_export

from heatertune.plc.cpu.iec.machine import TextProgram
from heatertune.plc.cpu.iec.st_syntax import units

IEC2C = shutil.which("iec2c")
TC6 = {"t": "http://www.plcopen.org/xml/tc6_0201", "x": "http://www.w3.org/1999/xhtml"}
SECTIONS = {"inputVars": "VAR_INPUT", "outputVars": "VAR_OUTPUT", "localVars": "VAR"}
#: inputs of WEG's block that are reserved words elsewhere: in WEG's own tool they are not
OF_WEG = {"Type": "Form", "Action": "Acting", "EN": "Enable", "FB_PID": "HT_WEG_PID"}

pytestmark = pytest.mark.skipif(IEC2C is None, reason="matiec's iec2c is not on the path")


def library():
    """Return matiec's library of standard functions; skip without one."""
    beside = Path(IEC2C).resolve().parent
    places = [os.environ.get("MATIEC_LIB"), beside / "lib", beside.parent / "lib", beside.parent / "share/matiec/lib"]
    for place in places:
        if place and (Path(place) / "ieclib.txt").is_file():
            return str(place)
    pytest.skip("the library of matiec is not beside iec2c; MATIEC_LIB names its folder")


def compiled(folder, text):
    """Return what matiec says of a text; empty where it compiles."""
    (folder / "exported.st").write_text(text, encoding="utf-8")
    done = subprocess.run([IEC2C, "-I", library(), "-T", str(folder), str(folder / "exported.st")], capture_output=True, timeout=60, check=False)
    return "" if done.returncode == 0 else (done.stdout + done.stderr).decode(errors="replace")


def configured(program, interval_ms):
    """Return a configuration that calls a program, as a project has it."""
    return (f"CONFIGURATION OfTest\nRESOURCE OfTestToo ON PLC\nTASK Cyclic(INTERVAL := T#{interval_ms}ms, PRIORITY := 0);\n"
            f"PROGRAM Instance WITH Cyclic : {program};\nEND_RESOURCE\nEND_CONFIGURATION\n")


def structured_text(project):
    """Return a PLCopen project as one structured text, the way that an editor hands it to matiec."""
    root = ElementTree.fromstring(project)
    text = "".join(_pou(pou) for pou in root.iterfind(".//t:pou", TC6))
    for configuration in root.iterfind(".//t:configuration", TC6):
        text += f"CONFIGURATION {configuration.get('name')}\n"
        for resource in configuration.iterfind("t:resource", TC6):
            text += f"RESOURCE {resource.get('name')} ON PLC\n"
            for task in resource.iterfind("t:task", TC6):
                text += f"TASK {task.get('name')}(INTERVAL := {task.get('interval')}, PRIORITY := {task.get('priority')});\n"
                for one in task.iterfind("t:pouInstance", TC6):
                    text += f"PROGRAM {one.get('name')} WITH {task.get('name')} : {one.get('typeName')};\n"
            text += "END_RESOURCE\n"
        text += "END_CONFIGURATION\n"
    return text


def _pou(pou):
    kind = {"functionBlock": "FUNCTION_BLOCK", "program": "PROGRAM"}[pou.get("pouType")]
    text = f"{kind} {pou.get('name')}\n"
    for section in pou.find("t:interface", TC6):
        constant = " CONSTANT" if section.get("constant") == "true" else ""
        text += SECTIONS[section.tag.rpartition("}")[2]] + constant + "\n"
        for variable in section.iterfind("t:variable", TC6):
            (kind_of,) = variable.find("t:type", TC6)
            type_ = kind_of.get("name") or kind_of.tag.rpartition("}")[2]
            value = variable.find("t:initialValue/t:simpleValue", TC6)
            initial = "" if value is None else f" := {value.get('value')}"
            text += f"  {variable.get('name')} : {type_}{initial};\n"
        text += "END_VAR\n"
    return f"{text}\n{pou.findtext('t:body/t:ST/x:p', '', TC6)}\nEND_{kind}\n"


def texts():
    """Yield label and structured text of every export that has one, a project's among them."""
    for export in every_export():
        for name, content in export.texts.items():
            if name.endswith(".xml"):
                yield f"{export.label}: {name}", structured_text(content)
            elif name == "weg_pid_call.st":
                yield f"{export.label}: {name}", _with_block_of_our_own(content, export.texts["weg_pid_block.st"])
            elif name.endswith(".st"):
                program = re.search(r"^PROGRAM (\w+)$", content, re.MULTILINE)
                yield f"{export.label}: {name}", content + ("" if program is None else configured(program[1], 20))


def _with_block_of_our_own(call, block):
    """Return the call of WEG's block, which is firmware, with the block of our own in its place."""
    renamed = re.sub(rf"\b({'|'.join(OF_WEG)})\b(?=\s*(:=|;))", lambda found: OF_WEG[found[1]], call)
    return re.search(r"FUNCTION_BLOCK.*?END_FUNCTION_BLOCK\n", block, re.DOTALL)[0] + renamed + configured("WegHeater", 20)


@pytest.mark.long(seconds=20)
def test_matiec_compiles_everything(tmp_path):
    refused = {label: said for label, text in texts() if (said := compiled(tmp_path, text))}
    assert not refused, "\n".join(f"{label}: {said.splitlines()[0]}" for label, said in refused.items())


@pytest.mark.parametrize(("old", "new"), [
    ("IntegralPart", "Integral"), ("Seconds", "Resource"), ("RESOURCE HeaterResource", "RESOURCE Resource"), ("END_IF;", "")])
def test_matiec_refuses_a_reserved_name_and_a_fault(tmp_path, old, new):
    text = next(text for label, text in texts() if label.startswith("iec-pid,") and label.endswith(".xml"))
    assert old in text
    assert compiled(tmp_path, text.replace(old, new))


MAIN = """
#include <stdio.h>
#include <string.h>
#include "POUS.h"
TIME __CURRENT_TIME;
BOOL __DEBUG = 0;
extern void {resource}_init__(void);
extern void {resource}_run__(unsigned long);
extern HEATER {resource}__HEATERPROGRAM;
static float of_bits(unsigned bits) {{ float value; memcpy(&value, &bits, 4); return value; }}
int main(void) {{
  unsigned on, hand, power, setpoint, temperature, bits;
  HEATER *h = &{resource}__HEATERPROGRAM;
  unsigned long tick = 0;
  {resource}_init__();
  while (scanf("%u %u %x %x %x", &on, &hand, &power, &setpoint, &temperature) == 5) {{
    h->HEATERON.value = on; h->BYHAND.value = hand; h->HANDPOWER.value = of_bits(power);
    h->HEATERSETPOINT.value = of_bits(setpoint); h->HEATERTEMPERATURE.value = of_bits(temperature);
    {resource}_run__(tick++);
    memcpy(&bits, &h->HEATERPOWER.value, 4);
    printf("%08x %d\\n", bits, {output});
  }}
  return 0;
}}
"""


def bits(value):
    """Return a REAL as 32 bits; one pattern for what is no number."""
    return "nan" if math.isnan(value) else struct.pack(">f", value).hex()


def inputs(chance, scans):
    """Yield what each scan is given: a process that moves, setpoints, times by hand, switching off, a sensor that breaks."""
    temperature, setpoint, on, hand, power = 20.0, 60.0, 1, 0, 0.0
    for _ in range(scans):
        temperature += chance.uniform(-2.0, 2.4)
        if chance.random() < 0.01:
            setpoint, power = chance.uniform(0.0, 120.0), chance.uniform(-20.0, 120.0)
        if chance.random() < 0.01:
            on, hand = int(chance.random() < 0.8), int(chance.random() < 0.3)
        if chance.random() < 0.005:
            temperature = chance.uniform(-20.0, 130.0)
        broken = chance.random() < 0.005
        yield on, hand, np.float32(power), np.float32(setpoint), np.float32(np.nan if broken else temperature)


@pytest.mark.long(seconds=20)
@pytest.mark.skipif(shutil.which("gcc") is None, reason="no gcc on the path, to run what matiec makes")
@pytest.mark.parametrize("target", ["iec-pid", "weg"])
def test_what_matiec_makes_runs_as_the_machine_of_the_proof_does(tmp_path, target):
    # matiec writes a literal as a double; as a single it is what the language says, and all bits are the same
    for seed, export in enumerate(controller_exports(target)):
        (project,) = (content for name, content in export.texts.items() if name.endswith(".xml"))
        text = structured_text(project)
        assert not compiled(tmp_path, text)
        pulses = "h->HEATEROUTPUT.value" if "HeaterOutput" in text else "0"
        (tmp_path / "main.c").write_text(MAIN.format(resource="HEATERRESOURCE", output=pulses), encoding="utf-8")
        subprocess.run(["gcc", "-w", "-O1", "-ffp-contract=off", "-fsingle-precision-constant", f"-I{library()}/C", "-o", "run", "main.c", "HeaterResource.c", "-lm"],
                       cwd=tmp_path, check=True, timeout=60)
        given = list(inputs(random.Random(seed), 3000))
        lines = "".join(f"{on} {hand} {' '.join(struct.pack('>f', one).hex() for one in reals)}\n" for on, hand, *reals in given)
        done = subprocess.run([tmp_path / "run"], input=lines.encode(), capture_output=True, check=True, timeout=60)
        theirs = [line.split() for line in done.stdout.decode().splitlines()]
        program = TextProgram(units(text[:text.index("CONFIGURATION ")]), {}, lambda ms: float(np.float32(ms / 1000)))  # matiec: seconds
        powers = set()
        for scan, ((on, hand, power, setpoint, temperature), (power_bits, pulse)) in enumerate(zip(given, theirs, strict=True)):
            program["HeaterOn"], program["ByHand"] = bool(on), bool(hand)
            program["HandPower"], program["HeaterSetPoint"] = float(power), float(setpoint)
            program["HeaterTemperature"] = float(temperature)
            program.scan()
            ours = program["HeaterPower"]
            assert (bits(ours), int(program["HeaterOutput"]) if pulses != "0" else 0) == (power_bits, int(pulse)), f"{export.label}, scan {scan}"
            powers.add(ours)
        assert len(powers) > 20, export.label
