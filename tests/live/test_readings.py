"""Readings: what is no number, out of the sensor's range or frozen is never taken for good; a loop at rest is not frozen."""

import math
import random
import struct
from dataclasses import replace

import pytest
from tests.bench import sessions
from tests.live.conftest import hasty_clock

from heatertune.errors import InputError
from heatertune.live.client.connection import address_of
from heatertune.live.experiment import AbortLimits, Experiment, Steps
from heatertune.live.loop_watch import BandWatch
from heatertune.live.poller import Snapshot as Seen
from heatertune.live.poller import StillSensor, reading_problem
from heatertune.live.write.band import Reach, RiseWatch, watch_response
from heatertune.live.write.plc_block import BlockSnapshot, block_image
from heatertune.live.write.proven_words import read_proven
from heatertune.live.write.write_record import WriteRecord
from heatertune.model.model_values import Fopdt

NAN, INF = math.nan, math.inf
STEP_S = 2.0  # between two looks
#: of the block's interface in the manual's order, in bytes: SetPoint, Feedback and Output, each a REAL
SETPOINT, FEEDBACK, ENO, OUTPUT, LENGTH = 2, 12, 46, 48, 52


@pytest.fixture(scope="session")
def proven(tmp_path_factory):
    return read_proven(sessions.folder_in(tmp_path_factory.mktemp("weg"), "weg"))


class Loop:
    """A PLC that is looked at: `shows` gives temperature and power at each look; its time runs as fast as it is asked."""

    def __init__(self, proven, shows, counter=False):
        self.standing = block_image(proven.words, address_of("modbus://127.0.0.1:1/1"), proven.view.stated_settings)
        self._shows, self._number, self._counter, self.clock = shows, 0, counter, hasty_clock()

    def look(self):
        degC, power = self._shows(STEP_S * self._number)
        content = bytearray(LENGTH)
        for at, value in ((SETPOINT, 50.0), (FEEDBACK, degC), (OUTPUT, power)):
            struct.pack_into(">f", content, at, value)
        if self._counter:  # ENO stands in for anything else that moves
            struct.pack_into(">H", content, ENO, self._number % 65536)
        self._number += 1
        read = bytes(content[self.standing.begin:])
        return BlockSnapshot(read, self.standing.values(read), None, STEP_S * (self._number - 1))

    def pause(self):
        pass


def ended(proven, tmp_path, shows, counter=False):
    """Return how a watch ends on such a loop."""
    loop = Loop(proven, shows, counter)
    with WriteRecord(tmp_path / "record.jsonl") as record:
        return watch_response(loop, record, proven, loop.look().values)


def noisy(seed=3, at=50.0, power=31.0):
    draw = random.Random(seed)
    return lambda _: (at + draw.choice((-0.05, 0.0, 0.05)), power + draw.uniform(-0.5, 0.5))


def test_a_loop_at_rest_is_watched_to_its_end(proven, tmp_path):
    end = ended(proven, tmp_path, noisy())
    assert (end.outside, end.ended_early) == ("", "")
    assert end.seconds >= 5 * 179


@pytest.mark.parametrize("value", [NAN, INF, -INF, 100.0, 150.0, -0.5, 3e38])
def test_readings_that_are_none_take_the_words_back(proven, tmp_path, value):
    good = noisy()
    end = ended(proven, tmp_path, lambda s: (value, 31.0) if s >= 300.0 else good(s))
    assert "the reading is " in end.outside, end
    assert end.seconds <= 300.0 + 2 * STEP_S
    end = ended(proven, tmp_path, lambda _: (value, 31.0))
    assert end.outside
    assert end.count == 0


def test_a_single_reading_that_is_none_is_disturbed_and_poisons_nothing(proven, tmp_path):
    good = noisy()
    end = ended(proven, tmp_path, lambda s: (NAN, 31.0) if s == 20.0 else good(s))
    assert (end.outside, end.ended_early) == ("", "")
    hot = ended(proven, tmp_path, lambda s: (NAN, 31.0) if s == 20.0 else (90.0, 0.0) if s > 300.0 else good(s))
    assert "90 °C is outside of the proven band" in hot.outside


def test_every_other_reading_without_a_number_is_not_watched(proven, tmp_path):
    good = noisy()
    end = ended(proven, tmp_path, lambda s: (NAN, 31.0) if s % (2 * STEP_S) else good(s))
    assert end.outside == ""
    assert "could not be used" in end.ended_early


@pytest.mark.long
def test_a_block_of_which_no_byte_changes_is_not_watched(proven, tmp_path):
    end = ended(proven, tmp_path, lambda _: (50.0, 31.0))
    assert end.outside == ""
    assert "no byte of the block has changed" in end.ended_early
    good = noisy()
    stopped = ended(proven, tmp_path, lambda s: good(s) if s < 300.0 else (50.0, 31.0))
    assert "no byte of the block has changed" in stopped.ended_early


def test_a_reading_that_stands_still_while_the_power_moves_is_frozen(proven, tmp_path):
    ramp = ended(proven, tmp_path, lambda s: (49.9, min(31.0 + 0.05 * s, 100.0)), counter=True)
    assert "the sensor is frozen" in ramp.outside
    assert ramp.seconds < 400.0


def test_a_coarse_sensor_at_rest_is_not_frozen(proven, tmp_path):
    draw = random.Random(5)
    end = ended(proven, tmp_path, lambda _: (50.0, 31.0 + draw.uniform(-1.0, 1.0)))
    assert (end.outside, end.ended_early) == ("", "")
    still = ended(proven, tmp_path, lambda _: (50.0, 31.0), counter=True)
    assert (still.outside, still.ended_early) == ("", "")


def seen(proven, shows, seconds=3000.0):
    beside = BandWatch(proven)
    for number in range(round(seconds / STEP_S)):
        degC, power = shows(STEP_S * number)
        beside.see(Seen(STEP_S * number, {"temperature": degC, "power": power, "setpoint": 50.0}))
    return beside.seen


@pytest.mark.long
def test_a_watch_tells_readings_that_are_none(proven):
    good = noisy()
    assert seen(proven, good).well
    for bad in (NAN, INF, -INF, 100.0, 200.0, -1.0):
        shown = seen(proven, lambda s, bad=bad: (bad, 31.0) if 500.0 <= s < 510.0 else good(s))
        assert not shown.well
        assert "5 readings could not be used" in shown.notes()[0]
    assert not seen(proven, lambda _: (NAN, 31.0)).well
    assert seen(proven, lambda s: (NAN, 31.0) if s == 500.0 else good(s)).well, "one of 1,500 is a disturbed one"
    assert not seen(proven, lambda s: (NAN, 31.0) if s % 100.0 < STEP_S else good(s)).well
    assert not seen(proven, lambda s: (good(s)[0], NAN)).well
    late = seen(proven, lambda s: (NAN, 31.0) if s == 0.0 else (90.0, 0.0) if s > 1500.0 else good(s))
    assert late.outside, "a first reading without a number leaves the band as it is"


@pytest.mark.long
def test_a_watch_tells_a_frozen_sensor_and_leaves_one_at_rest(proven):
    assert "the sensor is frozen" in seen(proven, lambda s: (50.1, max(31.0 - 0.02 * s, 0.0))).frozen
    assert not seen(proven, lambda _: (50.0, 31.0)).frozen
    assert seen(proven, lambda _: (50.0, 31.0)).still_s >= 2990.0
    draw = random.Random(7)
    assert seen(proven, lambda _: (50.0, 31.0 + draw.uniform(-1.0, 1.0))).well


def closed(kp, ki, gain, lag_s, dead_s, seconds=4000.0):
    """A PI in velocity form on a lag behind a dead time from cold, in Euler's steps of 0.1 s, read each 2 s."""
    degC, before, power, late, rows = 22.0, 0.0, 0.0, [0.0] * round(dead_s / 0.1), []
    for number in range(round(seconds / 0.1)):
        if number % 31 == 0:  # a call each 3.1 s
            error = 50.0 - degC
            power = min(max(power + kp * (error - before + ki * error * 3.1), 0.0), 100.0)
            before = error
        if number % 20 == 0:
            rows.append((0.1 * number, round(degC, 2), power))
        late.append(power)
        degC += 0.1 / lag_s * (22.0 + gain * late.pop(0) - degC)
    return rows


def watched_from(proven, rows, late_s):
    beside = BandWatch(proven)
    for at, degC, power in rows:
        if at >= late_s:
            beside.see(Seen(at, {"temperature": degC, "power": power, "setpoint": 50.0}))
    return beside.seen


@pytest.mark.long
def test_a_watch_that_begins_anywhere_in_a_heat_up_tells_nothing_against_a_loop_in_order(proven):
    kp, ki = proven.words.values["Kp"], proven.words.values["Ki"]
    rows = closed(kp, ki, sessions.GAIN, sessions.LAG_S, sessions.DEAD_S)
    draw = random.Random(11)
    for late_s in (0.0, *(draw.uniform(0.0, 600.0) for _ in range(25))):
        shown = watched_from(proven, rows, late_s)
        assert shown.well, (late_s, shown.notes())


@pytest.mark.long
@pytest.mark.parametrize("wrong", [{"kp": 6.0}, {"ki": 6.0}, {"gain": 6.0}, {"gain": 0.4}], ids=str)
def test_a_watch_that_begins_late_tells_a_wrong_loop(proven, wrong):
    part = {"kp": proven.words.values["Kp"], "ki": proven.words.values["Ki"], "gain": sessions.GAIN}
    rows = closed(*(value * wrong.get(name, 1.0) for name, value in part.items()), sessions.LAG_S, sessions.DEAD_S)
    assert not watched_from(proven, rows, 0.0).well
    if "ki" in wrong:  # later the others show nothing but a rest at the setpoint
        assert not watched_from(proven, rows, 40.0).well


def plant(gain, lag_s, dead_s, room, powers, start):
    """A lag behind a dead time in Euler's steps of 0.1 s, read each 2 s; nothing of heatertune is used."""
    degC, late, rows = start, [powers(0.0)] * round(dead_s / 0.1), []
    for k in range(round(4000.0 / 0.1)):
        if k % 20 == 0:
            rows.append((0.1 * k, degC, powers(0.1 * k)))
        late.append(powers(0.1 * k))
        degC += 0.1 / lag_s * (room + gain * late.pop(0) - degC)
    return rows


@pytest.mark.parametrize("seed", range(20))
def test_a_heater_that_follows_its_power_is_never_frozen_and_a_frozen_one_always(seed):
    draw = random.Random(seed)
    model = Fopdt(gain_degC_per_pct=draw.uniform(0.3, 4.0), time_constant_s=draw.uniform(40.0, 600.0),
                  dead_time_s=draw.uniform(0.2, 40.0), ambient_degC=22.0)
    levels = [draw.uniform(0.0, 100.0) for _ in range(8)]
    spread = [draw.uniform(0.7, 1.4) for _ in range(3)]  # the true heater is another one than the plausible ones
    rows = plant(model.gain_degC_per_pct * spread[0], model.time_constant_s * spread[1], model.dead_time_s * spread[2],
                 22.0 + draw.uniform(-5.0, 5.0), lambda s: levels[min(int(s // 500.0), 7)], draw.uniform(15.0, 80.0))
    digits = draw.choice((0, 1, 2))
    right, frozen = StillSensor([model], 1.0), StillSensor([model], 1.0)
    told = [right.see(s, round(degC, digits), power) for s, degC, power in rows]
    assert not any(told), next(filter(None, told))
    stuck = [frozen.see(s, round(degC if s < 1000.0 else rows[500][1], digits), power) for s, degC, power in rows]
    assert any(stuck)


def test_a_gap_between_looks_in_which_the_power_is_not_known_accuses_no_sensor():
    """60 % for one scan before the gap, 30 % before and after it: a heater at rest reads the same all the time."""
    model = Fopdt(gain_degC_per_pct=1.0, time_constant_s=100.0, dead_time_s=5.0, ambient_degC=22.0)
    sensor = StillSensor([model], 1.0)
    looks = [(2.0 * k, 60.0 if k == 50 else 30.0) for k in range(120) if not 50 < k < 90]
    assert [told for time_s, power in looks if (told := sensor.see(time_s, 52.0, power))] == []
    frozen = StillSensor([model], 1.0)  # the same power all the time until then, looked at: this one has to have moved
    assert any(frozen.see(2.0 * k, 52.0, 60.0 if k >= 50 else 30.0) for k in range(120))


def test_what_is_a_reading():
    assert reading_problem(20.0, (0.0, 100.0)) == reading_problem(0.0, (0.0, 100.0)) == ""
    for value in (NAN, INF, -INF, 100.0, -0.01, 1e300):
        assert reading_problem(value, (0.0, 100.0))
    assert reading_problem(20.0, (0.0, NAN))


def test_an_experiment_ends_where_the_reading_is_none(proven):
    limits = AbortLimits(temperature_degC=90.0, rate_degC_per_min=30.0)
    for value in (NAN, INF, -INF, 100.0, 0.0, -5.0):
        assert limits.broken([(0.0, 40.0), (1.0, 40.1), (2.0, value)], (0.0, 100.0))[0] == "sensor"
    assert limits.broken([(0.0, 40.0), (1.0, 40.1), (2.0, 40.2)], (0.0, 100.0)) is None
    assert limits.broken([(0.0, 40.0), (1.0, 40.1), (2.0, 91.0)], (0.0, 100.0))[0] == "limit"


def test_an_experiment_asks_for_no_more_power_than_the_words(proven):
    where, limits = address_of("modbus://127.0.0.1:1/1"), AbortLimits(temperature_degC=90.0)
    plan = Steps(steps=((0.0, 0.0), (100.0, 60.0)))
    Experiment(plan, where, proven.words, limits)
    held = type(proven.words)(**{name: getattr(proven.words, name) for name in ("target", "sample_time_s", "scaling", "ramp", "boost")},
                              values={**proven.words.values, "MaximumOutput": 50.0})
    with pytest.raises(InputError, match=r"the plan goes to 60 %, .* never ask for more than 50 %: plan again with --power 0 50"):
        Experiment(plan, where, held, limits)


@pytest.mark.parametrize("faster", [1.0, 1.8, 2.6, 5.0])
def test_a_rise_is_too_fast_where_a_heater_would_have_to_be_more_than_twice_as_fast_as_the_fastest(proven, faster):
    """Full power, and 21 % more by mains of +10 %, from the room's temperature on: a lag in Euler's steps; twice as fast, 2 · 0.9 · 121 °C / 167 s = 78 °C/min."""
    reach = Reach.from_proof(proven)
    assert reach.rate_degC_per_s == pytest.approx(2.0 * 0.9 * 121.0 / sessions.LAG_S)
    rise, degC, told = RiseWatch(reach), 22.0, []
    for number in range(1200):
        if number % 20 == 0:
            told.append(rise.see(0.1 * number, round(degC, 1)))
        degC += 0.1 * faster / sessions.LAG_S * (22.0 + 0.9 * 121.0 - degC)
    assert any(told) == (faster > 2.0)


def test_a_disturbed_reading_a_gap_and_a_plc_that_counts_again_are_no_rise(proven):
    rise = RiseWatch(Reach.from_proof(proven))
    rows = [(0.0, 40.0), (2.0, 70.0), (4.0, 40.1), (604.0, 75.0), (1.0, 30.0), (3.0, 30.1)]
    assert [rise.see(*row) for row in rows] == [""] * 6
    assert "has risen from 30 to 60 °C within 2 s" not in rise.see(3.5, 60.0)
    assert "the temperature has risen from 30 to 60.1 °C within 4 s" in rise.see(5.0, 60.1)


def limited(proven, degC):
    """Return words whose specification names a highest temperature."""
    return replace(proven, conditions=replace(proven.conditions, limit=(*proven.conditions.limit, f"peak={degC:g} degC")))


def test_a_watch_after_a_write_takes_back_at_the_highest_temperature_though_the_band_reaches_farther(proven, tmp_path):
    def shows(at):
        return 50.0 + 0.3 * math.sin(at), 31.0

    assert not ended(proven, tmp_path, shows).outside
    seen = ended(limited(proven, 50.2), tmp_path, shows)
    assert "the specification or interlock allows less than 50.2 °C" in seen.outside
    assert not ended(limited(proven, 50.4), tmp_path, shows).outside


def test_a_watch_tells_the_highest_temperature_and_a_rise_that_no_heater_makes(proven):
    rows = [(2.0 * k, 50.0 + 0.3 * math.sin(2.0 * k), 31.0) for k in range(400)]
    assert watched_from(proven, rows, 0.0).well
    hot = watched_from(limited(proven, 50.2), rows, 0.0)
    assert not hot.well
    assert "allows less than 50.2 °C" in hot.notes()[0]
    fast = [(at, degC + max(0.0, at - 400.0) * 3.0 if at < 412.0 else degC, power) for at, degC, power in rows]
    assert any("2 times as fast" in note for note in watched_from(proven, fast, 0.0).notes())
