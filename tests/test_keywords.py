"""The options of the functions are the same in the signature, in `help`, in an editor and on the command line."""

import inspect
import pickle
import re
import subprocess
import sys
from types import SimpleNamespace

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


@pytest.mark.parametrize(("call", "refusal"), [
    (lambda have: ht.prove(have.design, have.model), "prove: words is of type PidDesign; expected Words: encode(design, target, model) makes them"),
    (lambda have: ht.prove(have.words, have.model.model), "prove: fitted is of type Fopdt; expected FittedModel: fit(log) finds one, model_by_hand(heater) makes one"),
    (lambda have: ht.prove("words.json", have.model), "prove: words is 'words.json'; expected Words: encode(design, target, model) makes them"),
    (lambda have: ht.prove(have.words, have.model, {"setpoint_degC": 50.0}), "prove: conditions is of type dict; expected Conditions or None: "
     "give options by name, prove(..., name=value)"),
    (lambda have: ht.encode(have.model, "weg"), "encode: design is of type FittedModel; expected PidDesign: tune(model, target=...) finds one"),
    (lambda have: ht.encode(have.design, None), "encode: target is None; expected str"),
    (lambda have: ht.encode(have.design, "weg", scaling=(0, 100)), "encode: scaling is of type tuple; expected Scaling or None: or give range_degC=(low, high)"),
    (lambda have: ht.tune(have.model, "weg"), "tune: settings is 'weg'; expected TuneSettings or None: give options by name, tune(..., name=value)"),
    (lambda _: ht.design("table4", "weg"), "design: request is 'weg'; expected DesignRequest or None: "
     "give options by name, design(log, target=...)"),
    (lambda _: ht.design("table4", target="weg", read={"time_unit": "s"}), "design: read is of type dict; expected ReadSettings or None: "
     "heatertune.ReadSettings(name=value) is one"),
    (lambda have: ht.margins(have.design, have.model), "margins: heater is of type PidDesign; expected HeaterModel or FittedModel: "
     "fit(log) finds one, model_by_hand(heater) makes one"),
    (lambda have: ht.export(have.words, "out"), "export: proof is 'out'; expected Proof: prove(words, model) makes one"),
    (lambda have: ht.validate(have.model, "table4"), "validate: log is 'table4'; expected Log: read_log(path) reads one"),
    (lambda _: ht.load(5), "load: path is of type int; expected str or Path"),
    (lambda have: ht.front(have.model, ms=3), "no option 'ms'; did you mean 'ms_high'?"),
    (lambda have: ht.prove(have.words, have.model, limit=3), "limit = 3 is out of range: must be a text, or a list of texts"),
    (lambda have: ht.prove(have.words, have.model, switches="x"), "switches = 'x' is out of range: must be a dictionary, name to setting"),
    (lambda _: ht.Fopdt(gain_degC_per_pct="2", time_constant_s=9.0, dead_time_s=1.0), "gain_degC_per_pct = '2' is out of range: must be a number"),
    (lambda have: have.model.plot(), "a model given by hand has no log to draw; design.plot() and proof.plot() draw what comes of it"),
    (lambda have: ht.fit(have.words), "not a log: Words; expected a log, a path, an open file, a pandas table, or arrays (time_s, temperature_degC, power_pct)"),
])
def test_a_value_of_another_stage_is_refused_with_the_function_that_makes_the_right_one(call, refusal, model):
    design = ht.tune(model)
    with pytest.raises(InputError) as refused:
        call(SimpleNamespace(model=model, design=design, words=ht.encode(design, "s7-300")))
    assert str(refused.value) == refusal


def test_an_error_that_names_flags_has_a_note_of_their_names_in_python(model):
    with pytest.raises(InputError, match="give --ms, or a rule with --method") as refused:
        ht.tune(model, closed_loop_s=30.0)
    assert refused.value.__notes__ == ["--ms is ms in Python; --method is method in Python"]
    frame = pytest.importorskip("pandas").DataFrame({"temperature": [20.0] * 30})
    with pytest.raises(InputError, match="--log-interval with the seconds between two rows, or --time-column") as refused:
        ht.fit(frame)
    assert refused.value.__notes__ == ["--log-interval is sample_time_s in Python; --time-column is time_column in Python"]


def test_a_name_that_no_value_has_leads_to_the_one_that_was_meant(model):
    design = ht.tune(model)
    words = ht.encode(design, "s7-300")
    for value, wrong, meant in (
        (design, "Kp", "gain_pct_per_degC"), (design, "Ti", "integral_time_s"), (design, "TV", "derivative_time_s"),
        (design, "TA", "sample_time_s"), (model, "K", "model.gain_degC_per_pct"), (model, "tau", "model.time_constant_s"),
        (model, "theta", "model.dead_time_s"), (words, next(iter(words.values)), f"values[{next(iter(words.values))!r}]"),
        (design, "sumary", "summary"),
    ):
        with pytest.raises(AttributeError, match=f"has no attribute {wrong!r}: did you mean {re.escape(meant)}\\?$"):
            getattr(value, wrong)
        assert not hasattr(value, "_repr_png_")
    for wrong, meant in (("FOPDT", "Fopdt"), ("autotune", "tune"), ("proove", "prove")):
        with pytest.raises(AttributeError, match=f"did you mean {meant}\\?$"):
            getattr(ht, wrong)
    assert pickle.loads(pickle.dumps(words)) == words
    assert pickle.loads(pickle.dumps(ht.prove)) is ht.prove


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
