"""The options of the functions are the same in the signature, in `help`, in an editor and on the command line."""

import inspect
import pickle
import subprocess
import sys

import pytest

import heatertune as ht
from heatertune.errors import InputError, UnknownName, UnknownOption
from heatertune.options import options_of
from heatertune.settings import Conditions, FitSettings, ReadSettings, SensorSettings, TuneSettings, WordSettings
from tests import keywords
from tests.conftest import ROOT

VERBS = {
    ht.read_log: (ReadSettings,), ht.fit: (FitSettings, ReadSettings), ht.fit_together: (FitSettings,),
    ht.fit_known: (FitSettings,), ht.tune: (TuneSettings, SensorSettings), ht.encode: (SensorSettings,),
    ht.prove: (Conditions,), ht.design: (TuneSettings, SensorSettings, WordSettings, Conditions)}
WRONG = ROOT / "tests" / "wrong_calls.py"


@pytest.fixture(scope="module")
def model():
    heater = ht.Fopdt(gain_degC_per_pct=0.8, time_constant_s=120.0, dead_time_s=8.0, ambient_degC=21.0)
    return ht.model_by_hand(heater)


def test_the_keywords_that_an_editor_reads_are_those_of_the_options():
    assert keywords.FILE.read_text(encoding="utf-8") == keywords.content(), "run python -m tests.keywords --update"


@pytest.mark.parametrize("verb", VERBS, ids=lambda verb: verb.__name__)
def test_signature_and_help_list_every_option_with_unit_and_default(verb):
    options = {name: one for kind in VERBS[verb] for name, one in options_of(kind).items()}
    signature = inspect.signature(verb)
    shown = " ".join(inspect.getdoc(verb).split())
    for name, one in options.items():
        assert signature.parameters[name].default == one.default
        assert f"{name}: {one.quantity_with_unit}" in shown
    assert "changed" not in signature.parameters
    if verb is ht.tune:
        assert "ms: largest Ms of the optimum (default: 1.6)" in shown
        assert "closed_loop_s: closed-loop time constant of a rule [s] (default: the rule's own)" in shown


def test_a_misspelled_option_names_the_one_that_was_meant(model):
    design = ht.tune(model)
    words = ht.encode(design, "s7-300")
    for call, wrong, meant in (
        (lambda: ht.tune(model, structur="pi"), "structur", "structure"),
        (lambda: ht.tune(model, targt="weg"), "targt", "target"),
        (lambda: ht.tune(model, sample_time=1.0), "sample_time", "sample_time_s"),
        (lambda: ht.encode(design, "s7-300", range=(0.0, 100.0)), "range", "range_degC"),
        (lambda: ht.prove(words, model, assume={}), "assume", "switches"),
        (lambda: ht.prove(words, model, setpoint=50.0), "setpoint", "setpoint_degC"),
        (lambda: ht.fit("table3", ambient=22.0), "ambient", "ambient_degC"),
        (lambda: ht.read_log("table3", temperature_units="K"), "temperature_units", "temperature_unit"),
        (lambda: ht.design("table3", target="weg", aceept=("x",)), "aceept", "accept"),
    ):
        with pytest.raises(UnknownOption) as refused:
            call()
        assert str(refused.value) == f"no option {wrong!r}; did you mean {meant!r}?"
    with pytest.raises(UnknownOption, match=r"^no option 'zz'; known: structure, method"):
        ht.tune(model, zz=1)


def test_an_unknown_option_is_bad_input_and_a_type_error_and_travels_between_processes():
    problem = UnknownOption("structur", ("structure", "ms"))
    assert isinstance(problem, InputError)
    assert isinstance(problem, TypeError)
    assert str(pickle.loads(pickle.dumps(problem))) == str(problem)


def test_values_are_spelled_as_on_the_command_line(model):
    assert TuneSettings(structure="PI", objective="IAE") == TuneSettings(structure="pi", objective="iae")
    assert TuneSettings(sample_time_s="auto") == TuneSettings()
    assert WordSettings(setpoint_ramp="Auto").setpoint_ramp == "auto"
    assert Conditions(limit="overshoot=3degC").limit == ("overshoot=3degC",)
    assert Conditions(accept=["a", "b"]).accept == ("a", "b")
    assert SensorSettings(range_degC=[0, 200]).range_degC == (0.0, 200.0)
    with pytest.raises(UnknownName, match="unknown structure 'pip'; did you mean 'pi'\\? known: p, pi, pid"):
        TuneSettings(structure="pip")
    assert ht.tune(model, target="OB251").sample_time_s == ht.tune(model, target="s5-ob251").sample_time_s


def test_the_sensor_is_told_by_its_range_or_as_a_value_not_both(model):
    scaling = ht.Scaling(low_degC=0.0, high_degC=200.0)
    design = ht.tune(model, target="s5-ob251", range_degC=(0.0, 200.0))
    assert design == ht.tune(model, target="s5-ob251", scaling=scaling)
    assert ht.encode(design, "ob251", range_degC=(0.0, 200.0)) == ht.encode(design, "s5-ob251", scaling=scaling)
    with pytest.raises(InputError, match="give scaling or range_degC, not both"):
        ht.encode(design, "s5-ob251", scaling=scaling, range_degC=(0.0, 200.0))
    with pytest.raises(InputError, match="input needs a target"):
        ht.tune(model, input="4-20mA")


def test_a_design_takes_a_request_or_options_and_needs_a_target():
    with pytest.raises(InputError, match="no target: name the controller, one of s5-ob251"):
        ht.design("table3", structure="pi")
    request = ht.DesignRequest(target="OB251")
    assert request.target == "s5-ob251"
    with pytest.raises(InputError, match="ms: state it in the request"):
        ht.design("table3", request, ms=1.4)


def test_options_of_a_file_are_refused_for_a_log_that_is_read():
    log = ht.read_log("table3")
    with pytest.raises(InputError, match="time_unit: for a file; this log is read already"):
        ht.fit(log, time_unit="s")


@pytest.mark.long(seconds=20)
def test_mypy_refuses_each_of_forty_wrong_calls_and_none_of_the_right_ones(tmp_path):
    lines = WRONG.read_text(encoding="utf-8").splitlines()
    wrong = {number for number, line in enumerate(lines, 1) if line.endswith("# wrong")}
    assert len(wrong) == 40
    ran = subprocess.run(
        [sys.executable, "-m", "mypy", "--config-file", str(ROOT / "pyproject.toml"), "--cache-dir", str(tmp_path), "--follow-imports=silent",
         str(WRONG)], cwd=ROOT, capture_output=True, text=True, check=False)
    found = {int(line.split(":")[1]) for line in ran.stdout.splitlines() if line.startswith("tests/wrong_calls.py:") and ": error:" in line}
    assert found == wrong, ran.stdout + ran.stderr
