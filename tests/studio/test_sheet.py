"""A dropped file as it is understood, and what the user changes of it."""

import random
from collections import Counter

import numpy as np
import pytest
from tests.bench import drawn_exports as messy
from tests.studio.conftest import MALFORMED

from heatertune.log import read_log
from heatertune.settings import FitSettings
from heatertune.studio.charts import preview
from heatertune.studio.sheet_card import IGNORED, DroppedFile, answers_to, change_sheet, sheet
from heatertune.studio.wording import for_page

CSV = "time [s];T [°C];power [%];room\n" + "".join(
    f"{5 * k};{20 + 0.3 * k:.1f};{0 if k < 5 else 30};{k % 3}\n" for k in range(40)).replace(".", ",")


def dropped(text=CSV):
    return DroppedFile.of("log.csv", text.encode())


def place(found, role):
    return next(i for i, column in enumerate(found.columns) if column.role == role)


@pytest.mark.long
def test_every_messy_export_opens_and_what_was_guessed_can_be_said_word_for_word():
    told = Counter()
    for made in messy.files(len(messy.WRITERS), 3):
        found = DroppedFile.of("log.csv", made.text.encode(made.encoding))
        sheet(found)
        assert "--" not in for_page(found.problem).replace("---", "")
        if made.options or made.truth is None:
            told["asks"] += found.log is None
            continue
        assert messy.differs(found.log, made.truth) == "", made.kind
        again = found.with_role(0, found.columns[0].role)
        assert messy.differs(again.log, made.truth) == "", made.kind
        told["read"] += 1
    assert told["read"] >= 30
    assert told["asks"] >= 10


def test_what_only_the_user_can_know_is_chosen_on_the_sheet():
    counts = messy.counts(random.Random(1))
    found = dropped(counts.text)
    assert "reading at full power" in for_page(found.problem)
    assert messy.differs(change_sheet(found, "power_full_scale", 0, "255").log, counts.truth) == ""
    ovens = messy.two_ovens(random.Random(1))
    found = dropped(ovens.text)
    names = [tag.name for tag in found.tags]
    assert {"Ofen1.Temperatur", "Ofen2.Temperatur"} <= set(names)
    assert change_sheet(found, "tag", names.index("Ofen2.Temperatur"), "temperature").log is not None
    zones = "time [s],zone,T [°C]\n" + "".join(f"{k},{z},{20 + k + (z == 'B')}\n" for k in range(30) for z in "AB")
    found = dropped(zones)
    assert found.log is None
    found = change_sheet(found, "column", 1, "zone")
    assert (found.zones, found.zone) == (("A", "B"), "A")
    assert change_sheet(found, "zone", 0, "B").log.temperature_degC[0] == found.log.temperature_degC[0] + 1.0
    assert change_sheet(dropped(messy.minutes(random.Random(1)).text), "time_unit", 0, "min").settings.time_unit == "min"


def test_a_role_that_is_given_away_is_taken_from_who_had_it():
    found = dropped()
    assert [column.role for column in found.columns] == ["time", "temperature", "power", IGNORED]
    assert [column.unit for column in found.columns] == ["s", "degC", "100", ""]
    moved = change_sheet(found, "column", 3, "disturbance")
    assert moved.log.disturbance.tolist() == [k % 3 for k in range(40)]
    swapped = change_sheet(moved, "column", 2, IGNORED)
    assert swapped.log.power_pct is None
    other = change_sheet(found, "column", 3, "temperature")
    assert other.columns[1].role == IGNORED
    assert other.log.temperature_degC.tolist() == [k % 3 for k in range(40)]
    kelvin = change_sheet(found, "temperature_unit", 1, "K")
    assert kelvin.problem  # 20 K is no heater's
    assert kelvin.columns[1].unit == "K"


def test_what_the_file_does_not_say_is_assumed_in_sight_and_told():
    found = change_sheet(change_sheet(dropped(), "column", 2, IGNORED), "power_pct", 0, "37,5")
    assert set(found.log.power_pct) == {37.5}
    assert "taken as 37.5 % throughout, as you say" in found.log.repairs[-1]
    assert "as you say" in sheet(found)
    assert found.to_log()[1] == FitSettings(power_before_pct=0.0)
    found = change_sheet(found, "ambient_degC", 0, "21")
    assert found.to_log()[1] == FitSettings(power_before_pct=0.0, ambient_degC=21.0)
    assert change_sheet(dropped(), "power_pct", 0, "40").log.power_pct[0] == 0.0  # a logged power is believed


def test_the_largest_power_of_a_log_without_power_is_stated_in_sight_and_forgotten_where_power_is_known():
    found = change_sheet(change_sheet(dropped(), "column", 2, IGNORED), "largest_power_pct", 0, "70")
    assert "% largest power in this log" in sheet(found)
    assert found.to_log()[1] == FitSettings(largest_power_pct=70.0)
    powered = change_sheet(found, "column", 2, "power")
    assert "largest power" not in sheet(powered)
    assert powered.to_log()[1] == FitSettings()
    assert "must be <= 100" in change_sheet(found, "largest_power_pct", 0, "140").problem


@pytest.mark.parametrize(("change", "value", "told"), [
    ("ambient_degC", "warm", "'warm' is no number"), ("power_pct", "140", "must be <= 100"),
    ("skip_rows", "1.5", "no whole number"), ("skip_rows", "-1", "must be >= 0"), ("power_full_scale", "0", "must be > 0"),
])
def test_a_value_without_meaning_is_told_and_the_file_stays(change, value, told):
    found = change_sheet(dropped(), change, 0, value)
    assert told in found.problem
    assert found.log is None
    assert len(found.columns) == 4
    assert change_sheet(found, "ambient_degC", 0, "").log is not None


def test_what_is_no_table_is_shown_as_it_is():
    damaged = DroppedFile.of("log.xlsx", b"PK\x03\x04\x00")  # without python-calamine the extra is named
    assert "a workbook that is damaged" in damaged.problem or "heatertune[excel]" in damaged.problem
    assert not any(damaged.lines)
    assert DroppedFile.of("x.csv", b"").problem.startswith("x.csv: the file is empty")
    assert DroppedFile.of("C:\\logs\\..\\x.csv", MALFORMED).problem.startswith("x.csv, line 3, column temperature_degC")
    evil = DroppedFile.of("x.csv", b"<script>,b\n1,2\n1,2,3\n")
    assert "<script>" not in sheet(evil)
    assert "&lt;script&gt;" in sheet(evil)


def test_the_log_of_the_sheet_is_the_readers(tmp_path):
    path = tmp_path / "log.csv"
    path.write_text(CSV, encoding="utf-8")
    plain, found = read_log(path), dropped().log
    assert found.temperature_degC.tolist() == plain.temperature_degC.tolist()
    assert found.repairs == plain.repairs


def test_a_part_of_the_log_is_chosen_and_the_rest_shaded():
    found = change_sheet(dropped(), "window", 0, "50 150.0")
    log, known = found.to_log()
    assert (known.from_s, known.until_s) == (50.0, 150.0)
    assert "40 readings every 5 s" in sheet(found)
    assert "21 of them, from 50 to 150 s, are fitted" in sheet(found)
    assert len(log.time_s) == 40, "the fit leaves the rest out, the picture shows it"
    wide = 640 / 195  # of the picture, for a second
    assert f'x="0.0" y="0" width="{50 * wide:.1f}"' in preview(log, (50.0, 150.0))
    assert f'x="{150 * wide:.1f}" y="0" width="{45 * wide:.1f}"' in preview(log, (50.0, 150.0))
    few = change_sheet(found, "window", 0, "50 60")
    assert few.problem == "number of readings from 50 to 60 s = 3 is out of range: must be >= 20; log goes from 0 to 195 s"
    assert change_sheet(few, "until_s", 0, "").assumptions.until_s is None, "the fields under the message mend it"
    assert change_sheet(found, "window", 0, " ").assumptions.fit_settings == FitSettings(), "all of it again"


def test_the_preview_says_what_it_shows():
    log = dropped().log
    text = preview(log)
    assert f"Temperature from {log.temperature_degC.min():.4g} to {log.temperature_degC.max():.4g} °C in 195 s" in text
    assert text.count("<polyline") == 2
    assert np.ptp(log.time_s) == 195.0


@pytest.mark.parametrize(("power", "answer", "last_pct"), [
    # 4–20 mA: 12 mA are half the power; a S7's output word: 13,824 of 27,648 likewise; a name with a space is chosen whole
    ("output [mA],4,12", "--power-levels 4 20", 50.0), ("output,0,13824", "--power-full-scale 27648", 50.0),
    ("Valve pos [%],0,50", "--power-column Valve pos [%]", 50.0),
])
def test_what_a_message_asks_for_is_answered_by_one_choice(power, answer, last_pct):
    name, low, high = power.split(",")
    rows = "".join(f"{10 * k},{20 + 0.3 * k:.1f},{low if k < 20 else high}\n" for k in range(60))
    dropped = DroppedFile.of("oven.csv", f"time [s],oven [°C],{name}\n{rows}".encode())
    assert answer in answers_to(dropped.problem), dropped.problem
    assert f'value="{answer}"' in sheet(dropped)
    answered = change_sheet(dropped, "answer", 0, answer)
    assert answered.log is not None, answered.problem
    assert answered.log.power_pct[-1] == pytest.approx(last_pct)


def test_a_message_without_a_value_has_no_answer():
    assert answers_to("no column is a temperature (a, b); expected --temperature-column NAME or N") == {}
    assert answers_to("") == {}
    assert list(answers_to("expected --time-unit s, ms, min, h or d")) == [f"--time-unit {unit}" for unit in ("s", "ms", "min", "h", "d")]
    assert answers_to("(--skip-empty leaves such rows out)") == {"--skip-empty": ("skip_empty", True)}
    unknown = DroppedFile.of("empty.csv", b"")
    assert change_sheet(unknown, "answer", 0, "--power-levels 4 20").problem == unknown.problem


TEMPERATURE = ("time_s,temp_C\n" + "".join(f"{2 * k},{20 + 0.1 * k:.1f}\n" for k in range(100))).encode()
POWER = b"time_s,power_pct\n0,0\n31,60\n"


@pytest.mark.parametrize("turned", [False, True])
def test_two_files_that_are_dropped_are_one_log_where_one_holds_the_others_power(turned):
    first, second = DroppedFile.of("t.csv", TEMPERATURE), DroppedFile.of("p.csv", POWER)
    both = second.with_file(first) if turned else first.with_file(second)
    assert [*map(list, both.log.signals["power"].changes)] == [[0.0, 31.0], [0.0, 60.0]]
    assert "constant power" not in sheet(both)
    warmer = change_sheet(both, "power_full_scale", 0, "60")  # what is changed of it keeps both files
    assert warmer.log.signals["power"].values.max() == 100.0


def test_another_log_takes_the_place_of_one_that_waits():
    log = DroppedFile.of("t.csv", TEMPERATURE)
    whole = DroppedFile.of("w.csv", b"time_s,temp_C,power_pct\n" + b"".join(b"%d,%d,5\n" % (k, 20 + k % 7) for k in range(60)))
    assert log.with_file(whole) is whole
    assert whole.with_file(log) is log
    late = DroppedFile.of("p.csv", b"time_s,power_pct\n9000,0\n9100,50\n")
    assert log.with_file(late) is late  # of another time


KLIPPY = "".join(f"Stats {1000 + k}.0: heater_bed: target=60 temp={30 + k / 10:.1f} pwm=0.500 extruder: target=200 "
                 f"temp={40 + k / 2:.1f} pwm=0.700\n" for k in range(120)).encode()
SERIAL = "".join(f"10:00:{k:02d}.000 :  T:{30 + k:.2f} /200.00 B:{25 + k / 2:.2f} /60.00 @:64 B@:127\n" for k in range(60)).encode()


def test_each_heater_of_a_klippy_log_can_be_chosen(tmp_path):
    found = DroppedFile.of("klippy.log", KLIPPY)
    assert (found.zones, found.zone) == (("heater_bed", "extruder"), "extruder")
    assert 'aria-label="the heater that is read"' in sheet(found)
    bed = change_sheet(found, "zone", 0, "heater_bed")
    assert bed.zone == "heater_bed"
    assert bed.log.temperature_degC[-1] == pytest.approx(30 + 119 / 10, abs=0.06)
    alone = DroppedFile.of("klippy.log", KLIPPY.replace(b"heater_bed: target=60", b"board:"))
    assert alone.zones == ()
    assert "the heater that is read" not in sheet(alone)


def test_of_a_printers_reports_that_are_refused_for_several_heaters_one_can_be_chosen():
    refused = DroppedFile.of("serial.log", SERIAL)
    assert refused.log is None
    assert "several heaters" in refused.problem
    assert (refused.zones, refused.zone) == (("T", "B"), "")
    assert '<option value="" selected>choose</option><option value="T">' in sheet(refused)
    bed = change_sheet(refused, "zone", 0, "B")
    assert bed.log.temperature_degC[-1] == pytest.approx(25 + 59 / 2)
