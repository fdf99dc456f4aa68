"""The experiment: it begins only where all is as it was said, and whatever ends it, what stood there stands there again.

What stands in the PLC is read from the simulator's memory, not over the protocol that the experiment uses.
"""

import json
import random
import shutil
import struct
import sys
import time
from types import SimpleNamespace

import pytest
from tests.bench.kills import CELLS, of_experiment
from tests.live.conftest import DB, words_of
from tests.live.test_client import way
from tests.live.test_recorder import rows_of

from heatertune import InputError
from heatertune.cli import main
from heatertune.errors import DocumentError, OutOfRange
from heatertune.live.experiment import (
    AbortLimits,
    Aims,
    Experiment,
    ExperimentObserver,
    RelaySchedule,
    Steps,
    read_plan,
    restore,
)
from heatertune.live.hold import Hold
from heatertune.model.statistics import Interval

FAST = {"step": False, "rate": 2000.0, "dead_man": 3000}
PLAN = Steps(steps=((0.0, 0.0), (100.0, 60.0), (500.0, 20.0)))
ENDLESS = Steps(steps=((0.0, 10.0), (90000.0, 20.0)))  # 45 s at least by this clock: what is to end it always comes before
WARM = AbortLimits(temperature_degC=90.0)


@pytest.fixture(autouse=True)
def gateways_keep_nothing_for_long(monkeypatch):
    monkeypatch.setattr("heatertune.live.hold.LATE_S", 0.3)


def cells(plc):
    return plc.plc.memory.image()[CELLS]


def ran(plc, words, tmp_path, plan=PLAN, limits=WARM, protocol="s7", aims=None, timeout_s=2.0, **watching):
    """Run an experiment; return how it ended, and what stood there before."""
    whole = Experiment(plan, way(plc, protocol), words, limits, timeout_s=timeout_s)
    whole.check()
    before = cells(plc)
    ended = whole.run(tmp_path / "log.csv", aims, ExperimentObserver(**watching))
    return ended, before


#: target and protocol → bytes of mode and power in manual. OB251: manual, table 11-9. WEG: the interface in the manual's order, a
#: REAL in two registers: ManualSetPoint 3 and 4, SelectSetPoint 5. The PID of IEC 61131-3: X0 and AUTO, fourth and fifth of two each
BY_HAND = {("s5-ob251", "s7"): CELLS, ("s5-ob251", "modbus"): CELLS, ("weg", "modbus"): slice(6, 12), ("iec-pid", "modbus"): slice(12, 20)}


@pytest.fixture(params=BY_HAND, ids=" ".join)
def by_hand(request, served):
    """Return a way to serve a controller that has a manual mode, its words, its protocol, and the bytes of the mode."""
    target, protocol = request.param
    words = words_of(target)
    return (lambda **more: served(words, serve=protocol, **FAST | more)), words, protocol, BY_HAND[request.param]


@pytest.mark.long
def test_a_plan_is_run_and_all_is_given_back(by_hand, tmp_path):
    serve, words, protocol, part = by_hand
    plc = serve(rate=100.0)
    before = plc.plc.memory.image()[part]
    ended, _ = ran(plc, words, tmp_path, protocol=protocol)
    assert (ended.reason, ended.restored) == ("plan", True)
    assert plc.plc.memory.image()[part] == before
    assert Hold(way(plc, protocol)).way_back() is None
    rows = rows_of(tmp_path / "log.csv")
    after_s = rows[:, 0] - rows[0, 0]
    for begins, ends, power in ((70.0, 100.0, 0.0), (200.0, 500.0, 60.0), (600.0, 890.0, 20.0)):
        within = rows[(after_s > begins) & (after_s < ends), 2]
        assert within == pytest.approx(power, abs=100.0 / 2047)  # a whole unit of YH
    assert after_s[-1] >= 900.0


@pytest.mark.long
def test_limit_link_and_somebody_elses_hand_end_it_on_each_controller(by_hand, tmp_path):
    serve, words, protocol, part = by_hand
    # hot: it would come to rest at 76 °C, beyond the limit but within the sensor's range, however late somebody looks
    hot, mild = (Steps(steps=((0.0, power), (30000.0, power))) for power in (60.0, 20.0))

    def cut_off(name, plc, plan=mild, **more):
        (tmp_path / name).mkdir()
        before = plc.plc.memory.image()[part]
        ended, _ = ran(plc, words, tmp_path / name, plan, AbortLimits(temperature_degC=60.0), protocol=protocol, **more)
        return ended.reason, ended.restored, plc.plc.memory.image()[part] == before

    assert cut_off("limit", serve(rate=300.0), hot) == ("limit", True, True)
    rows = rows_of(tmp_path / "limit" / "log.csv")
    assert rows[:-2, 1].max() < 60.0 <= rows[-1, 1]
    assert cut_off("link", serve(rate=1000.0, faults="t=1000 cut until=2000")) == ("link", True, True)
    plc = serve(rate=1000.0)

    def other(so_far, _):
        if so_far.rows == 20:
            plc.plc.memory.write(plc.number, part.start, b"\1" * (part.stop - part.start))

    assert cut_off("hand", plc, on_row=other)[:2] == ("hand", False)
    assert plc.plc.memory.image()[part] == b"\1" * (part.stop - part.start)


@pytest.mark.long
def test_a_host_that_is_silent_is_followed_by_the_dead_man_and_the_next_start_gives_back(by_hand, tmp_path):
    serve, words, protocol, part = by_hand
    plc = serve(rate=300.0, dead_man=100)
    before, block = plc.plc.memory.image()[part], plc.plc.block

    class Dead(BaseException):
        pass

    def dies(so_far, _):
        if so_far.rows == 20:
            raise Dead

    whole = Experiment(PLAN, way(plc, protocol), words, WARM, timeout_s=2.0)
    whole.check()
    whole.hold.bring_back = lambda *_: None  # a host that is dead does nothing
    with pytest.raises(Dead):
        whole.run(tmp_path / "log.csv", watching=ExperimentObserver(on_row=dies))
    while block.in_manual(plc.plc.memory.image()):
        time.sleep(0.001)
    assert restore(way(plc, protocol)) is True
    assert plc.plc.memory.image()[part] == before


@pytest.mark.long
def test_a_relay_is_run(served, words, tmp_path):
    plan = RelaySchedule(rest_s=40.0, on_degC=44.0, off_degC=46.0, high_pct=80.0, low_pct=0.0, duration_s=2500.0)
    ended, _ = ran(served(**FAST | {"rate": 250.0}), words, tmp_path, plan)
    assert ended.reason == "plan"
    rows = rows_of(tmp_path / "log.csv")
    swings = rows[rows[:, 0] > rows[0, 0] + 800.0]
    assert swings[:, 1].min() < 44.5
    assert swings[:, 1].max() > 45.5
    assert (swings[swings[:, 1] > 46.0, 2] < 41.0).mean() > 0.8  # but for the calls on the way to YH


def test_the_limit_ends_it_at_the_second_look(served, words, tmp_path):
    plan = Steps(steps=((0.0, 100.0), (90000.0, 100.0)))
    ended, before = ran(plc := served(**FAST), words, tmp_path, plan, AbortLimits(temperature_degC=60.0))
    assert (ended.reason, ended.restored, cells(plc)) == ("limit", True, before)
    rows = rows_of(tmp_path / "log.csv")
    assert rows[:-1, 1].max() < 60.0 <= rows[-1, 1]


@pytest.mark.long
@pytest.mark.parametrize(("fault", "why"), [
    ("sensor-off", {"sensor"}), ("cpu-stop", {"silence"}), ("cut", {"link"}), ("black-hole", {"link"}), ("lost-reply", {"link"}),
    ("db-missing", {"silence", "link"})])  # that stops the CPU, too: which is seen first is a matter of the moment
def test_what_goes_wrong_ends_it(served, words, tmp_path, fault, why):
    plc = served(faults=f"t=4000 {fault} until=9000", **FAST)
    limits = AbortLimits(temperature_degC=95.0, silence_s=2.0)
    ended, before = ran(plc, words, tmp_path, Steps(steps=((0.0, 10.0), (20000.0, 20.0))), limits, timeout_s=0.3)
    assert ended.reason in why, ended
    assert ended.restored, ended
    assert cells(plc) == before
    assert Hold(way(plc, "s7")).way_back() is None


def test_a_rate_that_is_too_fast_ends_it(served, words, tmp_path):
    # 60 % leads to 76 °C: the limit of the temperature is not reached, however late a look comes
    limits = AbortLimits(temperature_degC=95.0, rate_degC_per_min=5.0)
    ended, _ = ran(served(**FAST | {"rate": 300.0}), words, tmp_path, Steps(steps=((0.0, 60.0), (9000.0, 0.0))), limits)
    assert ended.reason == "rate"


def test_somebody_elses_hand_ends_it_and_is_left_alone(served, words, tmp_path):
    plc, theirs = served(**FAST), struct.pack(">Hh", 33, 777)

    def shown(so_far, _):
        if so_far.rows == 30:
            plc.plc.memory.write(DB, CELLS.start, theirs)

    ended, _ = ran(plc, words, tmp_path, ENDLESS, on_row=shown)
    assert (ended.reason, ended.restored) == ("hand", False)
    assert cells(plc) == theirs


def test_a_key_ends_it(served, words, tmp_path):
    pressed = []

    def shown(so_far, _):
        pressed.extend([1] * (so_far.rows > 20))

    plc = served(**FAST)
    ended, before = ran(plc, words, tmp_path, ENDLESS, on_row=shown, key=lambda: bool(pressed))
    assert (ended.reason, ended.restored, cells(plc)) == ("key", True, before)


def test_it_ends_as_soon_as_enough_is_known(served, words, tmp_path):
    known = SimpleNamespace(model=SimpleNamespace(gain_degC_per_pct=0.9), ci95={"gain_degC_per_pct": Interval(low=0.85, high=0.95)})
    aims = Aims(shares={"gain_degC_per_pct": 0.06}, every_rows=10)
    ended, _ = ran(served(**FAST), words, tmp_path, ENDLESS, aims=aims, fit=lambda _: known)
    assert (ended.reason, ended.fitted_model) == ("known", known)


@pytest.mark.parametrize(("low", "high", "reached"), [(0.85, 0.95, True), (0.8, 0.95, False), (None, 0.95, False), (0.85, None, False)])
def test_an_open_interval_is_not_narrow(low, high, reached):
    fitted = SimpleNamespace(model=SimpleNamespace(time_constant_s=0.9), ci95={"time_constant_s": Interval(low=low, high=high)})
    assert Aims(shares={"time_constant_s": 0.06}).reached(fitted) is reached
    assert not Aims(shares={"time_constant_s": 0.9, "dead_time_s": 0.9}).reached(fitted)


def test_it_begins_on_no_other_words_no_hot_heater_no_stop_and_no_broken_sensor(served, words, tmp_path):
    def refused(plc, limits=WARM):
        with pytest.raises(InputError) as said:
            ran(plc, words, tmp_path, limits=limits)
        assert not list(tmp_path.iterdir())
        return str(said.value)

    plc = served()
    plc.release(60)
    assert "the limit is 30 °C" in refused(plc, AbortLimits(temperature_degC=30.0))
    plc.plc.memory.write(DB, 2, struct.pack(">h", 1234))
    assert "holds other words: K = KF +01234, not KF +06144" in refused(plc)
    stopped = served(faults="t=0 cpu-stop")
    stopped.release(2)
    assert "is in STOP" in refused(stopped)
    broken = served(faults="t=0 sensor-off")
    broken.release(2)
    assert "is the sensor there?" in refused(broken)


def test_a_controller_without_manual_is_told(served, tmp_path):
    with pytest.raises(InputError, match="no manual mode"):
        Experiment(PLAN, way(served(), "s7"), words_of("s7-200-pid"), WARM)


def test_a_log_that_is_there_is_not_touched(served, words, tmp_path):
    (tmp_path / "log.csv").write_text("mine")
    with pytest.raises(InputError, match="is there already; take another name"):
        ran(served(**FAST), words, tmp_path)
    assert (tmp_path / "log.csv").read_text() == "mine"


@pytest.mark.parametrize(("text", "parts"), [
    ("", ("line 1", "expected time_s,power_pct")), ("t,p\n0,1\n", ("line 1", "'t,p'")), ("time_s,power_pct\n0,20\n", ("1 steps",)),
    ("time_s,power_pct\n0,20\n5,x\n", ("line 3", "'5,x'")), ("time_s,power_pct\n0,20\n\n5,120\n", ("line 4", "power 120")),
    ("time_s,power_pct\n1,20\n5,10\n", ("line 2", "0 s first")), ("time_s,power_pct\n0,20\n0,10\n", ("line 3", "more than")),
    ("time_s,power_pct\n0,20\n5,nan\n", ("line 3", "2 numbers")), ("time_s,power_pct\n0,20\n5,10,3\n", ("line 3", "2 numbers")),
    ("rest_s,on_degC,off_degC,high_pct,low_pct,duration_s\n1,2\n", ("line 2", "6 numbers", "rest_s"))])
def test_a_bad_plan_is_told(tmp_path, text, parts):
    (tmp_path / "plan.csv").write_text(text)
    with pytest.raises(InputError) as refused:
        read_plan(tmp_path / "plan.csv")
    assert all(part in str(refused.value) for part in ("plan.csv", *parts)), refused.value


def test_a_relay_that_cannot_be_is_told(tmp_path):
    (tmp_path / "plan.csv").write_text("rest_s,on_degC,off_degC,high_pct,low_pct,duration_s\n31,36,35,85,0,600\n")
    with pytest.raises(OutOfRange, match="off_degC"):
        read_plan(tmp_path / "plan.csv")


def test_no_plan_is_told(tmp_path):
    with pytest.raises(InputError, match="cannot be read"):
        read_plan(tmp_path / "none.csv")


def _command(plc, folder, path, *more):
    host, port = plc.addresses["s7"]
    return [sys.executable, "-m", "heatertune", "experiment", str(path.with_name("plan.csv")), f"s7://{host}:{port}/0/2/db30",
            "--design", str(folder), "--limit-temperature", "90", "-o", str(path), *more]


def test_the_command_asks_first_and_ends_with_what_is_next(served, design_folder, tmp_path, capsys):
    (tmp_path / "plan.csv").write_text("time_s,power_pct\n0,10\n200,60\n")
    plc = served(**FAST)
    before, arguments = cells(plc), _command(plc, design_folder, tmp_path / "log.csv")[3:]
    assert main(arguments) == 2
    assert "answer at a terminal, or say --yes" in capsys.readouterr().err
    assert cells(plc) == before
    assert main([*arguments, "--yes", "--quiet"]) == 0
    said = capsys.readouterr().out
    assert "mode and manual value stand there as before" in said
    assert f"next: heatertune fit {tmp_path / 'log.csv'}" in said
    assert main([*arguments[:-1], str(tmp_path / "other.csv"), "--until", "gain=0%"]) == 2
    assert "--until 'gain=0%'" in capsys.readouterr().err


def test_no_experiment_goes_beyond_what_the_specification_allows(served, design_folder, tmp_path, capsys):
    """The interlock of the design opens the circuit at 65 °C; the controller holds 50 °C."""
    folder = tmp_path / "design"
    shutil.copytree(design_folder, folder)
    (tmp_path / "plan.csv").write_text("time_s,power_pct\n0,90\n400,0\n")
    plc = served(**FAST)
    arguments = _command(plc, folder, tmp_path / "log.csv", "--yes", "--quiet")[3:]
    at = arguments.index("--limit-temperature")
    unsaid = [*arguments[:at], *arguments[at + 2 :]]
    assert main(unsaid) == 2
    assert "the specification of the design names no highest temperature" in capsys.readouterr().err
    document = json.loads((folder / "pid.json").read_text())
    document["made_for"] = {"target": "s5-ob251", "conditions": {"interlock": "heater-fan", "limit_degC": 65.0}}
    (folder / "pid.json").write_text(json.dumps(document))
    assert main(arguments) == 2
    assert "--limit-temperature 90: the specification or interlock" in (refused := capsys.readouterr().err)
    assert "say 65 or less" in refused
    before = cells(plc)
    assert main(unsaid) == 1
    assert "the limit is 65 °C" in capsys.readouterr().out
    assert cells(plc) == before


def test_without_a_dead_man_it_wants_to_be_told_so(served, design_folder, tmp_path, capsys):
    (tmp_path / "plan.csv").write_text("time_s,power_pct\n0,10\n200,60\n")
    plc = served(**FAST | {"dead_man": 0})
    arguments = _command(plc, design_folder, tmp_path / "log.csv", "--yes", "--quiet")[3:]
    assert main(arguments) == 2
    assert "--without-dead-man begins all the same" in capsys.readouterr().err
    assert main([*arguments, "--without-dead-man"]) == 0


def test_a_fit_that_takes_long_does_not_keep_the_controller_in_manual(served, words, tmp_path):
    """The fit ends only when it sees the controller given back; it would wait for ever."""
    plc = served(**FAST)
    before = cells(plc)

    def fit(_log):
        while cells(plc) != before:
            time.sleep(0.001)
        raise InputError("too little")

    aims = Aims(shares={"gain_degC_per_pct": 0.01}, every_rows=10)
    ended, _ = ran(plc, words, tmp_path, aims=aims, fit=fit)
    assert (ended.reason, ended.restored) == ("plan", True)


@pytest.mark.long
def test_killed_at_any_moment_the_dead_man_acts_and_the_next_start_gives_back(served, design_folder, tmp_path):
    """`python -m tests.bench.kills` makes thirty."""
    of_experiment(lambda: served(**FAST | {"dead_man": 200}), design_folder, tmp_path, 2, random.Random(3))


@pytest.mark.parametrize(("field", "value"), [
    ("before", "zz"), ("block", "x"), ("start", None), ("own", ["00"]), ("address", "x"), ("process", None), ("schema", "heatertune/way-back/1"),
    ("parts", 1), ("sent_s", "x")])
def test_a_damaged_way_back_is_told(served, field, value):
    where = way(served(), "s7")
    state = Hold(where)
    part = {"start": 22, "before": "00210000", "own": ["00200000"]}
    document = {"schema": "heatertune/way-back/2", "command": "experiment", "address": where.text, "block": 30, "parts": [part],
                "power_pct": 10.0, "record": "log.csv", "begun": "2026-11-26", "process": 1, "sent_s": None}
    (part if field in part else document)[field] = value
    state.path.parent.mkdir(parents=True, exist_ok=True)
    state.path.write_text(json.dumps(document))
    with pytest.raises((DocumentError, InputError)):
        restore(where)
    assert state.path.exists()
    state.path.unlink()
