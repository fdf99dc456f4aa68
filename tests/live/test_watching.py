"""The watch: a loop in order is told nothing of; a fault that the virtual PLC has on its timetable is told as what it is."""

import json
import math
import random
from contextlib import nullcontext
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from tests.bench.second_monitor import NAMES, Monitors
from tests.live.test_client import way

from heatertune import virtual_plc
from heatertune.cli import main
from heatertune.errors import InputError
from heatertune.live.loop_watch import BandWatch, OnlineMonitor
from heatertune.live.poller import Poller, Snapshot
from heatertune.live.write.band import Band
from heatertune.live.write.proven_words import read_proven
from heatertune.model.statistics import Interval
from heatertune.settings import Conditions
from heatertune.supervision.monitor_design import read_supervision
from heatertune.supervision.supervise import SampleCounts, bench_of

FAST = {"step": False, "rate": 1500.0, "intervals": 4000}


@pytest.fixture(scope="session")
def folder(tmp_path_factory):
    """Words with their proof, as a user exports them."""
    where = tmp_path_factory.mktemp("watched")
    heater = ("--gain", "0.9", "--time-constant", "167", "--dead-time", "12", "--ambient", "22")
    # tuned for the controller, whose input module adds to the dead time: its small changes of the setpoint keep their limit
    assert main(["tune", *heater, "--target", "s5-ob251", "-o", str(where / "pid.json"), "--quiet"]) == 0
    assert main(["export-db", str(where / "pid.json"), "--target", "s5-ob251", "--setpoint", "50", "-o", str(where), "--quiet"]) == 0
    return where


@pytest.fixture
def watched(folder, tmp_path, capsys, monkeypatch):
    """Watch a PLC whose intervals wait for each look; one with a clock of its own runs ahead on a busy machine."""
    look = Poller.look

    def watch(*faults):
        with virtual_plc(folder, faults=list(faults), step=True) as plc, monkeypatch.context() as patch:
            patch.setattr(Poller, "look", lambda poller: (plc.release(1), look(poller))[1])
            status = main(["watch", way(plc, "s7").text, "--design", str(folder), "--duration", "9000", "-o", str(tmp_path / "log.csv"),
                           "--quiet", "--json"])
        return status, json.loads(capsys.readouterr().out)
    return watch


@pytest.mark.long
def test_a_loop_in_order_is_well_through_its_whole_heat_up(folder, watched, tmp_path):
    status, seen = watched()
    assert (status, seen["well"], seen["messages"], seen["outside_s"]) == (0, True, [], [])
    assert seen["rest_pct"] == pytest.approx([31.1, 31.1], abs=1.0)
    assert f"; PWM period: {read_proven(folder).view.actuator.pwm_period_s:.9g} s" in (tmp_path / "log.csv").read_text()


def test_an_experiment_and_a_recording_tell_the_period_of_the_proof(folder, tmp_path):
    (tmp_path / "plan.csv").write_text("time_s,power_pct\n0,10\n200,60\n")
    head = f"; PWM period: {read_proven(folder).view.actuator.pwm_period_s:.9g} s"
    with virtual_plc(folder, dead_man=1000, **FAST) as plc:
        where, design = way(plc, "s7").text, ["--design", str(folder), "--quiet", "-o"]
        assert main(["record", where, *design, str(tmp_path / "log.csv"), "--duration", "100"]) == 0
        assert main(["experiment", str(tmp_path / "plan.csv"), where, *design, str(tmp_path / "step.csv"),
                     "--limit-temperature", "90", "--yes"]) == 0
    assert all(head in (tmp_path / name).read_text() for name in ("log.csv", "step.csv"))


@pytest.mark.long
@pytest.mark.parametrize(("fault", "told"), [
    ("t=6000 half-power", "outside of the proven band"), ("t=6000 word K=24000", "swings by ±"), ("t=6000 ambient=-15", "% at rest, at first 3"),
    ("t=6000 sensor-half", "outside of the proven band"), ("t=6000 stuck-on", "outside of the proven band")])
def test_what_goes_wrong_is_told(watched, fault, told):
    status, seen = watched(fault)
    assert (status, seen["well"]) == (1, False)
    assert any(told in line for line in seen["messages"]), seen
    assert all(begin >= 5990.0 for begin, _ in seen["outside_s"]), seen


@pytest.mark.parametrize("fault", ["t=0 word K=600", "t=100 word TI=40"])
def test_words_that_were_not_proven_are_not_well_though_the_loop_rests(folder, tmp_path, capsys, fault):
    name, value = fault.rpartition(" ")[2].split("=")
    with virtual_plc(folder, faults=[fault], **FAST) as plc:
        status = main(["watch", way(plc, "s7").text, "--design", str(folder), "--duration", "300", "-o", str(tmp_path / "log.csv"), "--quiet"])
    said = " ".join(capsys.readouterr().out.split())
    assert (status, said.startswith("NOT WELL, ")) == (1, True)
    assert f"other words stand there than were proven: {name} is KF {int(value):+06d}, not KF {read_proven(folder).words.values[name]:+06d}" in said


def test_where_nobody_can_compare_the_words_that_is_told(folder, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("heatertune.live.loop_watch.block_image", partial(_unknown, "where the words stand is not known here"))
    with virtual_plc(folder, **FAST) as plc:
        main(["watch", way(plc, "s7").text, "--design", str(folder), "--duration", "300", "-o", str(tmp_path / "log.csv"), "--quiet"])
    said = " ".join(capsys.readouterr().out.split())
    assert "whether the words there are the proven ones is not known: where the words stand is not known here" in said


def _unknown(why, *_):
    raise InputError(why)


@pytest.mark.long
def test_the_limit_cycle_of_the_pwm_is_no_swing(folder):
    """A ripple within the PWM's own period is not one of the loop: the mean of each period is looked at."""
    proven = read_proven(folder)
    beside, period = BandWatch(proven), proven.view.actuator.pwm_period_s
    within = proven.view.criteria["limit_cycle"].limit
    for k in range(4000):
        ripple = 3.0 * within * (1.0 if k % 4 < 2 else -1.0)
        beside.see(Snapshot(k * period / 4.0, {"temperature": 50.0 + ripple, "power": 31.0, "setpoint": 50.0}))
    assert beside.seen.swing is None
    slow = BandWatch(proven)
    for k in range(1000):
        swing = 3.0 * within * (1.0 if k % 40 < 20 else -1.0)
        slow.see(Snapshot(k * period, {"temperature": 50.0 + swing, "power": 31.0, "setpoint": 50.0}))
    assert slow.seen.swing == pytest.approx((3.0 * within, 40.0 * period), rel=0.05)


def test_the_band_of_a_heat_up_allows_the_overshoot_that_was_proven(folder):
    proven = read_proven(folder)
    largest = max(proven.view.criteria[name].value for name in ("overshoot", "reheat_overshoot", "change_overshoot"))
    band = Band.of(proven, 50.0, 22.0)  # 28 °C below
    assert largest > 1.0
    assert band.at(0.0)[1] >= 50.0 + 28.0 * largest / 100.0
    small = proven.view.criteria["small_change_overshoot"].value  # of the change
    assert Band.of(proven, 50.0, 46.0).at(0.0)[1] >= 50.0 + 4.0 * small / 100.0


def test_a_refit_says_which_parameter_has_moved(folder, tmp_path, capsys, monkeypatch):
    """The fit itself is tested where it is; here a heater that has lost gain, known to 0.05 °C/%, stands in for it."""
    fitted = read_proven(folder).fitted_model
    lost = replace(fitted, model=replace(fitted.model, gain_degC_per_pct=0.5), ci95={"gain_degC_per_pct": Interval(low=0.45, high=0.55)})
    monkeypatch.setattr("heatertune.chain.fit", lambda _: lost)
    with virtual_plc(folder, **FAST) as plc:
        main(["watch", way(plc, "s7").text, "--design", str(folder), "--duration", "300", "-o", str(tmp_path / "log.csv"), "--quiet", "--refit"])
    said = capsys.readouterr().out
    assert "gain_degC_per_pct: 0.5 (95 %: 0.45 … 0.55); was 0.9: MOVED" in said
    assert "time_constant_s: 167 (95 %: not known); was 167\n" in said


def test_a_folder_without_a_proof_is_told(design_folder, capsys):
    assert main(["watch", "s7://127.0.0.1:1/0/2/db30", "--design", str(design_folder)]) == 2
    assert "proof.json" in capsys.readouterr().err


def test_who_has_seen_nothing_says_so_and_is_not_well(folder, tmp_path, capsys, monkeypatch):
    monkeypatch.setattr("heatertune.live.commands.record_watch.end_requests", lambda: nullcontext([1]))  # Ctrl-C before the first look
    with virtual_plc(folder, **FAST) as plc:
        status = main(["watch", way(plc, "s7").text, "--design", str(folder), "-o", str(tmp_path / "log.csv"), "--quiet"])
    assert (status, "nothing was seen" in capsys.readouterr().out) == (1, True)


@pytest.fixture(scope="session")
def monitor(folder):
    """The monitor of these words; how good it is, is tested where it is made."""
    assert main(["supervise", str(folder / "pid.json"), "--target", "s5-ob251", "--setpoint", "50", "--samples", "20",
                 "--faults-per-kind", "1", "-o", str(folder / "monitor"), "--quiet"]) == 0
    return folder / "monitor" / "supervision.json"


@pytest.mark.long
@pytest.mark.parametrize(("faults", "alarms"), [
    ([], set()), (["t=600 heater-open"], {"falls although heated", "heats too slowly"}), (["t=600 sensor-off"], {"sensor gone"})])
def test_a_monitor_beside_the_watch_sees_a_fault_and_trips_for_nothing_else(folder, monitor, tmp_path, capsys, faults, alarms):
    # the virtual PLC at 100 times its speed: a scan of 3.1 s each 31 ms, so that nearly each is looked at
    with virtual_plc(folder, faults=faults, step=False, rate=100.0, intervals=4000) as plc:
        status = main(["watch", way(plc, "s7").text, "--design", str(folder), "--monitor", str(monitor), "--duration", "900",
                       "-o", str(tmp_path / "log.csv"), "--quiet", "--json"])
    seen = json.loads(capsys.readouterr().out)["monitor"]
    assert seen["scans"] + seen["missed"] > 200, seen
    told = {each["name"] for each in seen["alarms"]}
    assert told & alarms or told == alarms, seen
    assert all(each["from_s"] >= 600.0 for each in seen["alarms"]), seen
    assert not faults or seen["alarms"][0]["from_s"] < 760.0, seen
    assert status == (1 if faults else 0)


@pytest.fixture(scope="session")
def days(folder, monitor):
    """What two drawn heaters in order live through, with outages: looks, scan by scan."""
    proven, view = read_proven(folder), read_supervision(monitor)
    bench = bench_of(proven.words, proven.fitted_model, Conditions(setpoint_degC=50.0), SampleCounts())
    stories = [bench.story(bench.family.member(10**6 + number)) for number in range(2)]
    return [looked(view, story.counts, story.power) for story in stories]


def looked(view, counts, powers):
    """The looks that a client has of counts of the card and powers; none without supply."""
    card = view.card
    return [Snapshot(k * view.scan_s, {"temperature": card.zero_degC + card.step_degC * count, "power": power, "setpoint": 50.0})
            for k, (count, power) in enumerate(zip(counts, powers, strict=True)) if power >= 0]


@pytest.mark.long
@given(st.integers(0, 10**6))
def test_looks_give_the_alarms_of_a_second_monitor_scan_by_scan(folder, monitor, seed):
    view, chance = read_supervision(monitor), random.Random(seed)
    level, counts, powers = 900.0, [], []
    for _ in range(200):
        level += chance.gauss(0.0, 20.0)
        counts.append(round(level))
        powers.append(chance.choice((0, 35, 100)))
    second, here = Monitors(view.numbers, 1), OnlineMonitor(view, read_proven(folder).words)
    for look, count, power in zip(looked(view, counts, powers), counts, powers, strict=True):
        before = {name: each.scans for name, each in here.alarms.items()}
        here.see(look)
        told = [name for name, each in here.alarms.items() if each.scans > before.get(name, 0)]
        assert (told or ["none"]) == [NAMES[second.feed(np.array([count]), np.array([power]))[0]]]


@given(st.integers(0, 10**6))
@pytest.mark.long
def test_scans_that_were_missed_are_no_fault_of_the_loop(folder, monitor, days, seed):
    """Of a loop in order, run by the proof's kernel, any looks at all give no alarm: gaps are filled or begin anew."""
    view, chance = read_supervision(monitor), random.Random(seed)
    share = chance.choice((0.02, 0.09, 0.3, 0.9))
    here = OnlineMonitor(view, read_proven(folder).words)
    seen = [each for each in chance.choice(days) if chance.random() >= share]
    for each in seen:
        here.see(each)
    assert not here.alarms
    assert not here.messages() or "blind" in here.messages()[0]
    assert here.scans == len(seen)
    assert here.missed <= 0.1 * here.scans


def test_a_monitor_of_other_words_and_one_without_the_power_are_refused(folder, monitor, tmp_path, capsys):
    document = json.loads(monitor.read_text())
    document["words"]["K"] += 1
    other = tmp_path / "supervision.json"
    other.write_text(json.dumps(document))
    assert main(["watch", "s7://127.0.0.1:1/0/2/db30", "--design", str(folder), "--monitor", str(other)]) == 2
    assert f"--monitor {other}: the monitor was made for other words" in capsys.readouterr().err
    with pytest.raises(InputError, match="the monitor needs the requested power"):
        OnlineMonitor(read_supervision(monitor), read_proven(folder).words).see(Snapshot(0.0, {"temperature": 20.0}))


@pytest.mark.parametrize(("place", "value", "told"), [
    (("card", "step_degC"), 0.0, "card: step_degC: 0; expected more than 0"), (("scan_s",), 0.0, "scan_s: 0; expected more than 0"),
    (("numbers", "block"), 0, "numbers: block 0"), (("numbers", "slow_blocks"), 500, "blocks back; expected less than 64")])
def test_a_damaged_monitor_is_told_before_anybody_is_looked_at(folder, monitor, tmp_path, capsys, place, value, told):
    document = json.loads(monitor.read_text())
    inner = document
    for name in place[:-1]:
        inner = inner[name]
    inner[place[-1]] = value
    damaged = tmp_path / "supervision.json"
    damaged.write_text(json.dumps(document))
    assert main(["watch", "s7://127.0.0.1:1/0/2/db30", "--design", str(folder), "--monitor", str(damaged)]) == 2
    assert told in capsys.readouterr().err


@pytest.mark.long
def test_a_monitor_that_never_sees_enough_in_a_row_says_that_it_is_blind(folder, monitor, days):
    """An open circuit, seen on days that only runs of scans tell: too short ones see nothing, and that is told, not "well"."""
    view, words = read_supervision(monitor), read_proven(folder).words
    # the windows' length, from the numbers as the table of `heatertune supervise` explains them
    needed = view.numbers["block"] * (1 + view.numbers["delay_high"] + max(view.numbers["slow_blocks"], view.numbers["fast_blocks"]))
    short, enough = OnlineMonitor(view, words), OnlineMonitor(view, words)
    for at, look in enumerate(days[0][:20 * (needed + 4)]):
        if at % (needed + 4) < needed - 1:
            short.see(look)
        if at % (needed + 4) < needed:
            enough.see(look)
    assert short.messages() == (f"monitor: blind: it needs {needed} scans in a row, and they never came",)
    assert short.to_document()["blind_share"] == 1.0
    assert enough.messages() == ()
    assert enough.watched == enough.begun_anew + 1
    assert enough.to_document()["blind_share"] == pytest.approx(1.0 - 1.0 / (needed + 4), abs=0.01)


@pytest.mark.long
def test_a_link_that_is_lost_and_not_back_is_not_well(folder, tmp_path, capsys, monkeypatch):
    class Ended:  # Ctrl-C after the link was lost
        more = 4

        def __bool__(self):
            self.more -= plc.plc.ended
            return self.more < 0

    monkeypatch.setattr("heatertune.live.commands.record_watch.end_requests", lambda: nullcontext(Ended()))
    # cut 2 s after the start, so that a slow machine has looked before
    with virtual_plc(folder, faults=["t=300 cut"], **FAST | {"intervals": 300, "rate": 150.0}) as plc:
        status = main(["watch", way(plc, "s7").text, "--design", str(folder), "-o", str(tmp_path / "log.csv"), "--quiet"])
    head, lost = capsys.readouterr().out.splitlines()[:2]
    assert status == 1
    assert head.startswith("NOT WELL, ")
    assert lost.startswith("- the link was lost and is not back: s7://")


def test_no_number_is_no_sensor_and_a_setpoint_beyond_the_monitors_is_told(folder, monitor):
    here = OnlineMonitor(read_supervision(monitor), read_proven(folder).words)
    for k, (degC, asked) in enumerate([(40.0, 50.0), (math.nan, 50.0), (40.0, 55.0)]):
        power = (30.0, math.nan, 1e300)[k]
        here.see(Snapshot(k * here.view.scan_s, {"temperature": degC, "power": power, "setpoint": asked}))
    assert next(iter(here.alarms)) == "sensor gone"
    assert "monitor: made for setpoints up to 50 °C, but 55 °C was requested" in here.messages()
