"""Zones in the studio: the names in a log, the request at the terminal and in Python, and what the page shows of a design."""

import asyncio
import io
import shlex
import zipfile

import numpy as np
import pytest
from tests.zones.networks import chain, logged, steps

from heatertune.cli import main
from heatertune.errors import ExportRefused, InputError
from heatertune.plc import Scaling
from heatertune.settings import Conditions
from heatertune.studio import zones_design
from heatertune.studio.background_work import Work
from heatertune.studio.loop_settings import StudioSettings
from heatertune.studio.session import Session
from heatertune.studio.zones_design import (
    DesignedZones,
    ZonesRequest,
    criteria_html,
    heaters_html,
    parameters_html,
    verdict_lines,
    zones_charts,
    zones_found,
)
from heatertune.zones import command, network_by_hand, prove_zones
from heatertune.zones.joint_proof import specification_for
from heatertune.zones.joint_tuning import JointTuner

NETWORK = chain(2, 1.0)
ZONES = ("front", "back")
REQUEST = {"zones": ZONES, "setpoints": "60, 55", "rated_kw": "3,5"}


@pytest.fixture(scope="module")
def content():
    """A CSV of two zones, each stepped by itself, by SciPy's exponential of the heat balance."""
    time, readings, powers = logged(NETWORK, steps(2, 3600, 15.0, 60.0), 1.0, 4, np.random.default_rng(1), 0.03)
    heads = ",".join(f"{zone} {role}" for role in ("temperature [°C]", "power [%]") for zone in ZONES)
    rows = [f"{t:g},{a:.2f},{b:.2f},{p:g},{q:g}" for t, (a, b), (p, q) in zip(time, readings, powers, strict=True)]
    return "\n".join([f"time [s],{heads}", *rows]).encode()


def sheet(*heads):
    rows = [",".join([str(row), *(f"{20 + row % 7}" for _ in heads[1:])]) for row in range(40)]
    return "\n".join([",".join(heads), *rows]).encode()


@pytest.mark.parametrize(("heads", "zones"), [
    (("time_s", "T1", "T2", "Q1", "Q2"), ("1", "2")),
    (("time_s", "Temp Düse [°C]", "Temp Zone 2 [°C]", "Power Düse [%]", "Power Zone 2 [%]"), ("Düse", "Zone 2")),
    (("time_s", "left temp", "left power", "right temp", "right power"), ("left", "right")),
    (("time_s", "temperature", "power"), ()),
    (("time_s", "left temperature", "right temperature", "power"), ()),
])
def test_the_names_of_zones_are_what_their_columns_differ_in(heads, zones):
    assert zones_found([("oven.csv", sheet(*heads))]) == zones


def test_files_of_one_heater_each_are_zones_of_their_names():
    log = sheet("time_s", "temperature [°C]", "power [%]")
    assert zones_found([("front.csv", log), ("back.csv", log)]) == ("front", "back")
    assert zones_found([("front.csv", log), ("power.csv", sheet("time_s", "power [%]"))]) == ()
    assert zones_found([("log.csv", b"\0\1")]) == ()


@pytest.fixture
def demanded(monkeypatch):
    """What `design_zones` is called with, by the command and by the page; nothing is fitted or designed."""
    found = []

    def design_zones(*args, **keywords):
        found.append((args[1:], keywords))
        raise InputError("asked for")

    for module in (command, zones_design):
        monkeypatch.setattr(module, "fit_network", lambda *_, **structure: found.append(structure) or network_by_hand(NETWORK))
        monkeypatch.setattr(module, "design_zones", design_zones)
    zones_design._fitted.cache_clear()
    yield found
    zones_design._fitted.cache_clear()


@pytest.mark.parametrize("settings", [
    {},
    {"target": "s7-300", "structure": "pid", "sample_time_s": 2.0, "pwm_period_s": 8.0, "tolerance_degC": 0.5,
     "high_degC": 150.0},
    {"input": "4-20mA", "limits": ("overshoot=24%",), "assumptions": (("rounding", "whole_increments"),)},
])
def test_the_command_asks_for_what_the_page_asks_for(settings, content, demanded, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "oven.csv").write_bytes(content)
    more = {"peak_kw": 5.5, "deviation_degC": 3.0, "neighbours": "chain", "spread_degC": 4.5} if "target" in settings else {}
    request = ZonesRequest(files=(("oven.csv", content),), settings=StudioSettings(**settings), **REQUEST, **more)
    with pytest.raises(InputError, match="asked for"):
        zones_design.design_of(request, str)
    assert main([*shlex.split(request.command)[1:], "--quiet"]) == 2
    shown, typed = demanded[:2], demanded[2:]
    assert shown == typed
    assert shown[1][1]["specification"].rated_kw == (3.0, 5.0)


def test_numbers_that_are_none_are_told_with_what_is_expected(content):
    request = ZonesRequest(files=(("oven.csv", content),), zones=ZONES, settings=StudioSettings(), setpoints="60; 55")
    with pytest.raises(InputError, match=r"setpoints 60; 55: expected numbers with commas between them"):
        zones_design.design_of(request, str)


def test_a_design_that_fails_is_shown_with_what_is_not_kept():
    fitted = network_by_hand(NETWORK)
    design = next(JointTuner(fitted, "s7-300", scaling=Scaling(low_degC=0.0, high_degC=200.0)).designs())
    proof = prove_zones(design, fitted, specification_for(fitted, 140.0, Conditions()), up_to_failure=True)
    first, reasons = verdict_lines(proof)
    assert first.startswith("FAIL: 2 zones together at 140, 140 °C")
    assert "not kept: power to hold the setpoints" in reasons
    assert "FAIL" in criteria_html(proof)
    assert heaters_html(proof.fitted).count("<tr>") == 1 + 2 * 4 + 1 + 2, "heads, heaters of two zones, both ways of the exchange"
    parameters = parameters_html(proof)
    assert [place in parameters for place in ("DB 100", "DB 110")] == [True, True]
    temperatures, powers = zones_charts(proof)
    assert [line["name"] for line in temperatures["series"]] == ["a", "setpoint a", "b", "setpoint b"]
    assert [line["name"] for line in powers["series"]] == ["a", "b"]
    with pytest.raises(ExportRefused):
        DesignedZones(request=None, proof=proof).zip(force=False)


@pytest.fixture(scope="module")
def design(content):
    work = Work(Session())

    async def designed():
        await work.offer_zones([("oven.csv", content)])
        await work.design_zones(ZonesRequest(files=work.zone_files, settings=StudioSettings(target="s7-300"), **REQUEST))

    asyncio.run(designed())
    assert (work.zone_names, work.zones_error) == (ZONES, "")
    return work.zones


@pytest.mark.long
def test_the_command_and_the_program_make_the_files_of_the_page(design, content, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "oven.csv").write_bytes(content)
    archive = zipfile.ZipFile(io.BytesIO(design.zip(force=False)))
    shown = {name: archive.read(name) for name in archive.namelist()}
    assert main([*shlex.split(design.request.command)[1:], "--out", "out", "--quiet"]) == 0
    stored = [path for path in (tmp_path / "out").rglob("*") if path.is_file()]
    assert {path.relative_to(tmp_path / "out").as_posix(): path.read_bytes() for path in stored} == shown
    made = {}
    exec(design.request.program, made)
    files = {name: text.encode() if isinstance(text, str) else text for name, text in made["files"].items()}
    assert files.items() <= shown.items()


@pytest.mark.long
def test_a_folder_of_zones_is_shown_as_it_was_designed(design, tmp_path):
    (tmp_path / "data").mkdir()
    (tmp_path / "data" / "zones.json").write_text(str(design.files(force=False)["data/zones.json"]), encoding="utf-8")
    work = Work(Session())
    assert work.load_zones(str(tmp_path))
    assert (work.zones.proof.words, work.zones.proof.verdict) == (design.proof.words, "PASS")
    # once the page showed the controller, the structure and the range that it begins with
    assert (work.session.settings.target, work.session.settings.structure) == (design.proof.words[0].target, design.proof.design.structure)
    assert work.session.settings.scaling == design.proof.words[0].scaling
    assert not work.load_zones("table4")
