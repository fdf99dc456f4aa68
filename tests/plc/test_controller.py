"""A controller as a class: what it must say, what it inherits, and where it is registered."""

import subprocess
import sys
from dataclasses import replace

import pytest
from tests.conftest import ROOT

from heatertune import chain
from heatertune.errors import InputError, NotRepresentable, OutOfRange, UnknownName
from heatertune.pid.design_values import PidDesign, Timer
from heatertune.plc import (
    TARGETS,
    Controller,
    ControllerState,
    Scaling,
    StepFunctions,
    Timing,
    WordField,
    Words,
    controller_for,
    count,
)
from heatertune.plc.words import round_to_word, timer_interval_s

PLC = ROOT / "src" / "heatertune" / "plc"
DESIGN = PidDesign(gain_pct_per_degC=1.45, integral_time_s=100.0, derivative_time_s=0.0, sample_time_s=2.0, structure="pi",
                   method="")


def _parts(**changed):
    """Return the body of a class: a P controller of 100 counts over the range, whose K is in tenths."""
    return {
        "title": "for the test", "main_file": "k.txt", "can": (), "cannot": (), "inputs": {"SP": "INT", "PV": "INT"}, "counts": 100,
        "fields": (WordField(name="K", address="1", format="INT", low=1, high=99, comment=""),),
        "timer": Timer(shortest_s=0.5, longest_s=10.0, step_s=0.5),
        "core": StepFunctions(step=lambda k, n, w, x, _: (n + 1, float(k * (w - x)), n, 0), measure=count, flags=()),
        "values": staticmethod(lambda design, _: {"K": 10.0 * design.gain_pct_per_degC}),
        "design": staticmethod(lambda _: None),
        "export": staticmethod(lambda words, _: {"k.txt": str(words.values["K"])}),
        "begin": lambda _self, words, _assume: ControllerState(words.values["K"], 0),
    } | changed


def _made(name="for-the-test", without=(), **changed):
    body = {key: value for key, value in _parts(**changed).items() if key not in without}
    return type("ForTheTest", (Controller,), {"__module__": __name__, **body}, name=name)


def test_the_list_of_targets_is_the_folders_that_have_a_controller_each_with_the_same_files():
    folders = {path.parent.name for path in PLC.glob("*/controller.py")}
    assert {package.rpartition(".")[2] for package in TARGETS.values()} == folders
    for name, package in TARGETS.items():
        folder = PLC / package.rpartition(".")[2]
        assert folder.name == name.replace("-", "_")
        source = (folder / "controller.py").read_text(encoding="utf-8")
        # a make of firmware is a row with its words, law and text beside it, and so is a program of a few words; any other controller
        # has a file for each, PID_Temp but for its text, which is PID_Compact's
        in_one_file = "controller_of(FirmwarePid(" in source or name in {"on-off", "s7-200", "iec-pid-text"}
        code = {"controller.py"} if in_one_file else {"controller.py", "words.py", "step.py", "export.py"} - {
            "export.py" if name == "pid-temp" else ""}
        assert {"__init__.py", *code} <= {path.name for path in folder.glob("*.py")}, name
        assert not in_one_file or {path.name for path in folder.glob("*.py")} == {"__init__.py", *code}, name
        assert {"DIFFERENCES.md", "COMMISSIONING.md"} <= {path.name for path in folder.glob("*.md")}, name
        assert controller_for(name) is controller_for(name)
        assert (controller_for(name).name, type(controller_for(name)).__module__) == (name, f"{package}.controller")


def test_who_asks_for_the_names_of_the_targets_loads_no_controller():
    code = ("import sys; from heatertune.plc import TARGETS; assert 'weg' in TARGETS; "
            "print([m for m in sys.modules if m == 'numpy' or m.startswith('heatertune.plc.') and m != 'heatertune.plc.targets'])")
    assert subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True).stdout.strip() == "[]"


@pytest.mark.parametrize("missing", ["title", "main_file", "fields", "core", "timer", "counts", "inputs", "can", "cannot"])
def test_a_class_that_leaves_something_unsaid_is_not_made(missing):
    with pytest.raises(TypeError, match=f"ForTheTest does not say its {missing}"):
        _made(without=[missing])


@pytest.mark.parametrize("missing", ["values", "design", "export", "begin"])
def test_a_class_without_a_method_that_only_it_can_have_makes_no_controller(missing):
    _made(name="half-a-controller", without=[missing])
    with pytest.raises(TypeError, match=missing):
        controller_for("half-a-controller")


def test_no_class_takes_the_name_of_a_controller_that_is_there():
    with pytest.raises(TypeError, match="weg is a controller of heatertune"):
        _made(name="weg")
    with pytest.raises(UnknownName, match="s5-ob251"):
        controller_for("nobody")


def test_a_class_of_the_users_is_a_target_everywhere_and_inherits_the_rest():
    _made()
    own = controller_for("for-the-test")
    words = chain.encode(DESIGN, "for-the-test", scaling=Scaling(low_degC=0.0, high_degC=200.0))
    assert words == Words(target="for-the-test", values={"K": 15}, scaling=Scaling(low_degC=0.0, high_degC=200.0), sample_time_s=2.0)
    assert own.timing(words) == Timing(scan_s=2.0)
    assert (own.switches, own.decode(words), own.measure(words, 41.0)) == ((), None, 20)  # 200 °C are 100 counts
    running, first = own.step(own.start(words, {}), 22, 20)
    _, second = own.scan(running, {"SP": 21, "PV": 20})
    assert [first.power_pct, second.power_pct, second.output] == [30.0, 15.0, 1]
    assert own.start_directly(words, {}) == (own.core, own.start(words, {}))
    with pytest.raises(InputError, match="no setpoint ramp"):
        own.ramp(words, 1.0)
    with pytest.raises(InputError, match=r"dump\.bin: words of for-the-test cannot be read back"):
        own.read_image(b"", sample_time_s=1.0, scaling=Scaling(), source="dump.bin")


def test_what_the_words_hold_beside_the_values_is_checked():
    _made(name="clocked", interval_s=staticmethod(lambda values: values["K"] / 10.0), scans_per_period=4)
    own = controller_for("clocked")
    words = own.encode(DESIGN, Scaling())
    assert words.sample_time_s == 1.5  # K = 15, whatever TA was
    assert own.timing(words) == Timing(scan_s=0.375, pwm_period_s=1.5)
    with pytest.raises(OutOfRange, match=r"sample_time_s = 2\.0 .*1\.5 s"):
        own.check(Words(target="clocked", values={"K": 15}, scaling=Scaling(), sample_time_s=2.0))
    with pytest.raises(NotRepresentable, match="word K would be 100, allowed a whole number 1…99"):
        own.encode(PidDesign(gain_pct_per_degC=10.0, integral_time_s=9.0, derivative_time_s=0.0, sample_time_s=2.0,
                             structure="pi", method=""), Scaling())


@pytest.mark.parametrize("interval", [0.0, -1.0, float("nan"), float("inf")])
@pytest.mark.parametrize("target", TARGETS)
def test_no_controller_is_called_at_an_interval_that_is_none(target, interval):
    which = controller_for(target)
    legal = which.encode(replace(DESIGN, sample_time_s=which.timer.round(DESIGN.sample_time_s)), Scaling())
    with pytest.raises(OutOfRange, match="sample_time_s"):
        controller_for(target).check(Words(target=target, values=legal.values, scaling=Scaling(), sample_time_s=interval))


@pytest.mark.parametrize("target", TARGETS)
def test_no_controller_overrides_what_all_do_alike(target):
    final = {name for kind in Controller.__mro__ for name, value in vars(kind).items()
             if getattr(getattr(value, "fget", value), "__final__", False)}
    assert {"encode", "decode", "check", "read_image", "timing", "ramp", "start", "start_directly", "step", "scan"} < final
    assert not final & set(vars(type(controller_for(target))))


def test_what_only_some_controllers_can_is_said_by_their_class():
    def of(attribute):
        return {name: value for name in TARGETS if (value := getattr(controller_for(name), attribute)) is not None}

    assert of("integers") == {"s5-ob251": ("K", "TI", "TD"), "s7-200": ("KP", "KI", "KD")}
    assert of("baseline") == {name: "on-off" for name in TARGETS if name != "on-off"}
    assert of("scans_per_period") == {"s7-200": 1, "s7-200-paper": 5, "s7-200-pid": 1}
    for name, words in of("integers").items():  # a search moves whole numbers only
        assert {f.format for f in controller_for(name).fields if f.name in words} <= {"INT", "KF"}


@pytest.mark.parametrize("target", TARGETS)
@pytest.mark.parametrize(("ta", "fits"), [(1e-5, "shortest_s"), (1e6, "longest_s"), (1.00037, None)])
def test_an_interval_that_a_timer_cannot_keep_is_refused_in_one_wording(target, ta, fits):
    timer = controller_for(target).timer
    design = PidDesign(gain_pct_per_degC=1.5, integral_time_s=100.0, derivative_time_s=0.0, sample_time_s=ta, structure="pi",
                       method="")
    nearest = timer.round(1.0) if fits is None else getattr(timer, fits)
    allowed = f"{timer.shortest_s:g}…{timer.longest_s:g} s in steps of {timer.step_s:g} s"
    with pytest.raises(NotRepresentable) as refused:
        controller_for(target).encode(design, Scaling())
    remedy = f"{nearest:g} s would fit (tune --sample-time {nearest:g})"
    assert str(refused.value) == f"sampling interval TA would be {ta:g}, allowed {allowed}; {remedy}"


def test_an_interval_is_kept_as_the_timer_counts_it():
    assert timer_interval_s(Timer(shortest_s=0.1, longest_s=9.0, step_s=0.1), 0.1 + 0.2) == 0.3


WHOLE = WordField(name="N", address="1", format="INT", low=-99, high=99, comment="")
REAL = WordField(name="G", address="1", format="REAL", low=-3.4028234663852886e38, high=3.4028234663852886e38, comment="")


@pytest.mark.parametrize(("exact", "held"), [
    (0.1, 0.100000001490116119384765625), (0.0, 0.0), (-3.4028234663852886e38, -3.4028234663852886e38),
])
def test_a_real_is_rounded_once(exact, held):
    assert round_to_word(REAL, exact) == held


@pytest.mark.parametrize("exact", [3.5e38, -1e39, 1e-46])
def test_a_real_that_would_be_infinite_or_nothing_is_refused(exact):
    with pytest.raises(NotRepresentable, match=r"word G would be .* a number in single precision; a size between"):
        round_to_word(REAL, exact)


@pytest.mark.parametrize(("exact", "held"), [(2.5, 3), (-2.5, -3), (2.49, 2), (98.6, 99), (0.4, 0)])
def test_a_whole_word_is_rounded_once_halves_away_from_zero(exact, held):
    word = round_to_word(WHOLE, exact)
    assert (word, type(word)) == (held, int)


@pytest.mark.parametrize("exact", [99.5, -100, float("inf")])
def test_a_whole_word_beyond_its_range_is_refused(exact):
    with pytest.raises(NotRepresentable, match=r"word N would be .* a whole number -99…99"):
        round_to_word(WHOLE, exact)


@pytest.mark.parametrize("target", [target for target in TARGETS if controller_for(target).most_power])
def test_a_limited_output_ends_at_that_share_of_full_power(target):
    which = controller_for(target)
    design = PidDesign(gain_pct_per_degC=1.0, integral_time_s=60.0, derivative_time_s=0.0, sample_time_s=which.timer.round(1.0),
                       structure="pi", method="")
    words = which.with_output_limit(which.encode(design, Scaling()), 40.0)
    running, (low, high) = which.start(words, {}), which.ends(words)
    for _ in range(200):
        running, scan = which.step(running, high, low)
    assert scan.power_pct == pytest.approx(40.0, abs=0.03)  # 2047 units are 100 %
