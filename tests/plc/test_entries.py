"""What a person enters: one rendering of each word, the same on screen, in the record and in the file that is loaded first.

The files are read here by plain patterns that share nothing with what wrote them.
"""

import csv
import math
import random
import re
from fractions import Fraction

import numpy as np
import pytest
from tests.plc.export_corpus import controller_exports

from heatertune.errors import HeatertuneError
from heatertune.pid.design_values import PidDesign
from heatertune.plc import ALIKE, NAMES, Certificate, Scaling, controller_for
from heatertune.plc.core import Sensor
from heatertune.plc.keyed_entry import setpoint_entry, typed_words
from heatertune.plc.targets import commissioning

MAKES = ("pband", *ALIKE["pband"])
#: how the file that is loaded first sets a word of that name; None: the values stand in statements of their own
PATTERNS = {
    "weg": r"\b{name} := ([^,;)\s]+)", "iec-pid": r"\b{name} := ([^,;)\s]+)", "iec-pid-text": r"\b{name} := ([^,;)\s]+)",
    "klipper": r"^{name}: (\S+)$", "marlin": r"^(?:// )?(?:#define )?(?:DEFAULT_)?{name} (?:= )?([^\s:]+)", "esphome": r"^ *{name}: (\S+?)(?:ms)?$",
    "fb41": r"^ *{name} := (\S+)", "simple-pid": r"\b{name}\s?=\s?([^,\s)]+)",
}
#: the part of the file that sets the words: the call of the controller's block, or its data block
PARTS = dict.fromkeys(("weg", "iec-pid", "iec-pid-text"), r"HeaterPid\((.*?)\);") | {"fb41": r"^DATA_BLOCK DB 41$(.*?)^END_DATA_BLOCK"}


def number(text):
    """Return what a literal is: whole, real, a duration in ms, TRUE and FALSE."""
    plain = text.strip().upper().removeprefix("KF").removeprefix("KM").strip(" =")
    if plain in ("TRUE", "FALSE"):
        return float(plain == "TRUE")
    if plain.startswith("T#"):
        return float(plain.removeprefix("T#").removesuffix("MS"))
    return float(int(plain.replace(" ", ""), 2)) if "KM" in text else float(plain)


def numbers_in(text):
    """Return every number of a text, also those of TRUE and FALSE."""
    found = {float(np.float32(float(each))) for each in re.findall(r"(?<![\w.])[+-]?\d+(?:\.\d+)?(?:[eE][+-]?\d+)?", text)}
    return found | {1.0, 0.0} if "TRUE" in text or "FALSE" in text else found


@pytest.mark.parametrize("target", NAMES)
def test_the_main_file_is_among_the_files_and_the_first_that_the_steps_name(target):
    main = controller_for(target).main_file
    steps = " ".join(commissioning(target).steps["Entering the parameters"])
    for export in controller_exports(target):
        assert main in export.files
        named = sorted((steps.index(f"`{name}`"), name) for name in export.files if f"`{name}`" in steps)
        assert not named or named[0][1] == main
        assert "rollback" not in main


@pytest.mark.parametrize("target", PATTERNS)
def test_each_word_is_entered_as_the_main_file_sets_it(target):
    for export in controller_exports(target):
        text = export.files[controller_for(target).main_file].replace("\r\n", "\n")
        if target in PARTS:
            (text,) = re.findall(PARTS[target], text, re.DOTALL | re.MULTILINE)
        for row in typed_words(export.words, 60.0):
            pattern = PATTERNS[target].format(name=re.escape(row.name))
            found = set(re.findall(pattern, text, re.MULTILINE))
            assert found or (target, row.name) in NOT_IN_THE_FILE, (export.label, row.name)
            for each in found - {"True", "False"}:
                if target in ("fb41", "simple-pid"):  # STEP 7 writes mantissa and exponent, Python 1.0 or 1
                    assert np.float32(number(each)) == np.float32(number(row.then_text)), (export.label, row.name)
                else:
                    assert each.upper() == row.then_text.upper(), (export.label, row.name)
            assert math.isclose(number(row.then_text), export.words.values[row.name], rel_tol=1e-7), (export.label, row.name)


@pytest.mark.parametrize("target", ["s5-ob251", "s7-300", "pid-compact", "pid-temp", "pid-temp-cooling", "arduino-pid", "s7-200-pid", "s7-200"])
def test_each_word_that_is_entered_stands_in_the_main_file_as_a_number(target):
    for export in controller_exports(target):
        there = numbers_in(export.files[controller_for(target).main_file])
        for row in typed_words(export.words, 60.0):
            if row.format != "KM" and (target, row.name) not in NOT_A_NUMBER_OF_THE_FILE:
                assert float(np.float32(number(row.then_text))) in there, (export.label, row.name, row.then_text)


#: words that the module has under another name
NOT_IN_THE_FILE = {("simple-pid", "output_max"), ("simple-pid", "differential_on_measurement")}
#: scales that statements divide by, the sampling interval that a program keeps in ticks, and settings that are letters
NOT_A_NUMBER_OF_THE_FILE = {("s7-200", "SCALE"), ("s7-200", "KP"), ("s7-200", "KI"), ("s7-200", "KD"), ("arduino-pid", "POn")}


@pytest.mark.parametrize("target", MAKES)
def test_a_panel_instrument_s_words_are_shown_with_their_decimals_and_only_the_list_of_registers_has_whole_numbers(target):
    stem = target.replace("-", "_")
    for export in controller_exports(target):
        sheet = dict(line.split(";")[0].split()[:2] for line in export.files[f"{stem}_sheet.txt"].splitlines() if not line.startswith(";"))
        rows = [line for line in export.files[f"{stem}_registers.csv"].splitlines() if not line.startswith("#")]
        registers = {row["name"]: row for row in csv.DictReader(rows)}
        shown = {row.name: row.then_text for row in typed_words(export.words)}
        assert shown == sheet
        tenths = export.words.values.get("TIMEUNIT", 0)  # Omron: both times count tenths of a second
        for name, text in shown.items():
            row = registers[name]
            places = int(row["decimals"]) if row["format"] == "INT16" else 0
            value = Fraction(row["value"]) / 10**places / (10**tenths if name in ("I", "D") and "TIMEUNIT" in shown else 1)
            assert Fraction(text) == value, (export.label, name)
            assert name in ("TIMEUNIT",) or "decimal" not in next(r.meaning for r in typed_words(export.words) if r.name == name)


@pytest.mark.parametrize("target", NAMES)
def test_the_setpoint_is_told_in_the_unit_in_which_it_is_entered(target):
    for export in controller_exports(target):
        text = setpoint_entry(export.words, 45.0)
        assert "units" not in text
        (value,) = re.findall(r"(?:= |^)([+-]?\d+(?:\.\d+)?)", text)
        span = export.words.scaling.span_degC
        if "°C" in text:
            assert abs(float(value) - 45.0) <= span / controller_for(target).counts
        else:
            whole = {"s5-ob251": 2047, "s7-200": 255, "s7-200-paper": 255, "s7-300": 27648, "fb41": 27648, "on-off": 4095,
                     "s7-200-pid": 32000 if "VW80" in text else 1}[target]
            assert abs(float(value) * span / whole + export.words.scaling.low_degC - 45.0) <= span / min(whole, 4000) if whole > 1 else True


@pytest.mark.parametrize(("low", "high"), [(0, 100), (0, 150), (-50, 150), (0, 400), (-20, 130), (0, 1200), (-200, 850)])
@pytest.mark.parametrize("target", NAMES)
def test_no_setpoint_of_a_tenth_of_a_degree_loses_a_count(target, low, high):
    controller = controller_for(target)
    sensor = Sensor(float(low), float(high - low), controller.counts)
    lowest, highest = (float(controller.core.measure(sensor, each)) for each in (float(low), 2.0 * high))
    step = (highest - lowest) / controller.counts
    for tenths in range(10 * low, 10 * high + 1, 1 if high - low <= 400 else 7):
        exact = math.floor((Fraction(tenths, 10) - low) * controller.counts / (high - low))
        assert round((controller.core.measure(sensor, tenths / 10) - lowest) / step) == exact, tenths


@pytest.mark.long
@pytest.mark.parametrize("target", NAMES)
def test_files_of_random_designs_read_back_and_show_what_is_entered(target):
    chance, controller, compared = random.Random(5), controller_for(target), 0
    timer = controller.timer
    for _ in range(25):
        ta = timer.step_s * round(min(max(10 ** chance.uniform(-1, 1.2), timer.shortest_s), timer.longest_s) / timer.step_s)
        tv, low = chance.choice([0.0, 10 ** chance.uniform(-1, 2.3)]), chance.choice([0.0, -50.0, 20.0])
        design = PidDesign(gain_pct_per_degC=10 ** chance.uniform(-1.5, 1.5), integral_time_s=10 ** chance.uniform(0.7, 3.3), derivative_time_s=tv,
                           sample_time_s=ta, structure="pid" if tv else "pi", method="")
        try:
            words = controller.encode(design, Scaling(low_degC=low, high_degC=low + chance.choice([80.0, 250.0, 1200.0])))
        except HeatertuneError:
            continue  # what no word holds is refused: tests/laws
        files = controller.export(words, Certificate(verdict="PASS", setpoint_degC=low + chance.uniform(5.0, 60.0)))
        main = files[controller.main_file]
        if target in MAKES:
            sheet = dict(line.split(";")[0].split()[:2] for line in main.splitlines() if not line.startswith(";"))
            assert sheet == {row.name: row.then_text for row in typed_words(words)}
        if controller.text is not None and target not in ("on-off", "s5-ob251"):  # machine code, and a program with several blocks
            assert dict(controller.text(main, words.sample_time_s, controller.main_file).values) == dict(words.values)
        compared += 1
    assert compared > 3
