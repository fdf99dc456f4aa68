"""A cut of the exports of many tools: the shortest runs; the others are `long`."""

import importlib.util
import random
from collections import Counter
from pathlib import Path

import pytest

from heatertune.cli import main
from heatertune.errors import LogError
from heatertune.log import read_log
from tests.bench.messy import ACCUSED, REMEDY, RIGHT, STUCK, WRONG, judge, printed
from tests.bench.tool_exports import LEVELS, WRITERS, damage, exports

#: tools whose exports say all that a fit needs: no question may be left
SAY_ALL = ("12-hour dates", "xlsx", "compressed CSV", "klippy.log", "OctoPrint serial.log", "Repetier", "HOBO", "Artisan CSV")
#: read in seconds: one of each kind of parser
QUICK = [("12-hour dates", "hostile"), ("Excel, Japanese", "messy"), ("compressed CSV", "hostile"), ("parquet", "messy"), ("MATLAB", "hostile"),
         ("klippy.log", "hostile"), ("OctoPrint serial.log", "messy"), ("Artisan alog", "messy"), ("ESPHome log", "messy"),
         ("Node-RED JSON lines", "hostile"), ("InfluxDB line protocol", "hostile"), ("LabVIEW", "messy"), ("Ignition", "messy"),
         ("CODESYS trace", "hostile"), ("Yokogawa", "messy"), ("generic CSV", "messy"), ("loose probe", "hostile"), ("heater opens", "hostile"),
         ("bipolar output", "hostile"), ("Peltier rig", "messy"), ("fan", "hostile"), ("room", "messy"), ("4-20 mA", "hostile"),
         ("decimal commas between commas", "hostile")]
CALAMINE = importlib.util.find_spec("python_calamine")


def outcome(tool, level, folder):
    (export,) = exports(tool, level)
    if tool == "xlsx" and CALAMINE is None:
        pytest.skip("python-calamine is not installed")
    return judge(export, folder)


def test_there_are_more_than_eighty_exports_of_three_levels():
    assert len(WRITERS) > 80
    assert {level for _, level, _ in WRITERS} == {*LEVELS}


@pytest.mark.parametrize(("tool", "level"), QUICK)
def test_an_export_is_fitted_to_its_heater_or_is_a_question_with_an_answer(tmp_path, tool, level):
    found, said = outcome(tool, level, tmp_path)
    assert found in (RIGHT, REMEDY), said


#: tools with an export of each level; the clean one is the messy one without what disturbs it
THREE = {tool for tool, count in Counter(tool for tool, *_ in WRITERS).items() if count == len(LEVELS)}


@pytest.mark.long
@pytest.mark.parametrize(("tool", "level"), [
    pytest.param(tool, level, marks=[pytest.mark.sample] * (level == "clean" and tool in THREE))
    for tool, level, _ in WRITERS if (tool, level) not in QUICK])
def test_every_export_is_fitted_to_its_heater_or_is_a_question_with_an_answer(tmp_path, tool, level):
    found, said = outcome(tool, level, tmp_path)
    assert found in (RIGHT, REMEDY), said
    if tool in SAY_ALL and level != "hostile":
        assert found == RIGHT, said


def test_the_bench_sees_a_wrong_heater_and_a_refusal(tmp_path):
    (export,) = exports("12-hour dates", "clean")
    wrong = export.__class__(**{**{name: getattr(export, name) for name in export.__dataclass_fields__}, "heater": export.heater._replace(gain=0.9)})
    assert judge(wrong, tmp_path)[0] == WRONG
    nothing = export.__class__("a photograph", "hostile", "x.png", b"\x89PNG\r\n\x1a\n" + bytes(range(256)) * 4, export.heater)
    assert judge(nothing, tmp_path)[0] == STUCK
    table = printed([(export, RIGHT, []), (wrong, WRONG, ["said"])], verbose=True)
    assert "2 exports: 1 right at once" in table
    assert "1 WRONG HEATER, 0 FALSE ACCUSATION" in table
    assert ACCUSED not in table.split("2 exports")[0]


@pytest.mark.long
def test_no_damage_to_an_export_ends_in_anything_but_a_log_or_one_line():
    made = list(exports())
    outcomes = set()
    for number in range(200):
        chance = random.Random(f"damage-{number}")
        export = chance.choice(made)
        try:
            outcomes.add(len(read_log(export.name, content=damage(export.content, chance)).time_s) > 0)
        except LogError as problem:
            outcomes.add(f"refused in {len(str(problem).splitlines())} line")
    assert outcomes == {True, "refused in 1 line"}


def test_a_workbook_without_its_library_names_the_extra(tmp_path, monkeypatch, capsys):
    monkeypatch.setitem(__import__("sys").modules, "python_calamine", None)
    (export,) = exports("xlsx", "clean")
    path = Path(tmp_path / export.name)
    path.write_bytes(export.content)
    assert main(["read", str(path)]) == 2
    assert "pip install 'heatertune[excel]'" in capsys.readouterr().err
