"""What printers' own rules say, worked out by hand from what their sources and manuals say they do."""

import numpy as np
import pytest

from heatertune.supervision.supervise import Protection, VerifyHeater, klipper, lines_of, marlin

MARLIN = Protection(hysteresis=4.0, period=40.0, watch_increase=2.0, watch_period=20.0, min_temp=5.0, max_temp=260.0)
KLIPPER = VerifyHeater(hysteresis=5.0, max_error=120.0, heating_gain=2.0, check_gain_time=20.0, min_temp=0.0, max_temp=260.0)


def stops(rule, seen, target=200.0):
    aims = np.broadcast_to(np.asarray(target, dtype=float), len(seen))
    return (klipper if isinstance(rule, VerifyHeater) else marlin)(rule, np.asarray(seen, dtype=float), aims, 1.0, 0)[0]


def test_marlin_waits_a_period_once_the_heater_was_warm():
    warm = [*range(100, 201, 2), *[200] * 10]
    assert stops(MARLIN, [*warm, *[196] * 300]) == -1  # 4 °C below is not too far
    # it was right last in scan 60; 41 s later, the first moment above 40 s
    assert stops(MARLIN, [*warm, *[195] * 300]) == len(warm) - 1 + 41
    assert stops(MARLIN, [*warm, *[195] * 40, 196, *[195] * 40]) == -1


def test_marlin_watches_the_way_in_each_period_of_it_and_not_its_last_part():
    # asked for in scan 0, looked at 20 s later: the first scan after it
    assert stops(MARLIN, [100] * 100) == 21
    assert stops(MARLIN, [100 + k // 10 for k in range(900)]) == -1  # 2 °C in each 20 s
    assert stops(MARLIN, [195] * 300) == -1  # less than 2 + 4 °C away it does not look
    assert stops(MARLIN._replace(watch_increase=0.0), [100] * 900) == -1


def test_klipper_adds_up_what_is_missing_once_the_way_has_ended():
    # on its way until 20 s have brought less than 2 °C; what was added up until then, 20 s of 95 °C, is too much at once
    assert stops(KLIPPER, [100] * 100) == 21
    assert stops(KLIPPER, [*[200] * 9, *[194] * 500]) == 9 + 119  # 1 °C beyond the hysteresis, 120 s
    assert stops(KLIPPER, [*[200] * 9, *[194] * 100, 195, *[194] * 100]) == -1


def test_both_stop_beyond_their_ends_while_they_heat_and_not_while_they_are_off():
    for rule in (MARLIN, KLIPPER):
        assert stops(rule, [200] * 5 + [261]) == 5
        assert stops(rule, [200] * 5 + [-1]) == 5
        assert stops(rule, [200] * 5 + [261], [200.0] * 5 + [0.0]) == -1


def test_the_lines_are_those_that_the_configuration_takes():
    file, text = lines_of(KLIPPER, ["head"], {"heater": "extruder"})
    assert file == "klipper_verify_heater.cfg"
    assert text.startswith("# head\n[verify_heater extruder]\nhysteresis: 5\nmax_error: 120\nheating_gain: 2\ncheck_gain_time: 20\n")
    _, text = lines_of(MARLIN, ["head"], {"heater": "hotend"})
    assert "#define THERMAL_PROTECTION_PERIOD 40\n#define THERMAL_PROTECTION_HYSTERESIS 4\n#define WATCH_TEMP_PERIOD 20\n" in text
    assert "WATCH_TEMP_INCREASE" not in lines_of(MARLIN._replace(watch_increase=0.0, watch_period=0.0), [], {})[1]


@pytest.mark.parametrize(("rule", "heater", "lines"), [
    (KLIPPER, "heater_bed", ("[verify_heater heater_bed]",)), (KLIPPER, None, ("[verify_heater YOUR_HEATER]",)),
    (MARLIN, "bed", ("#define THERMAL_PROTECTION_BED_PERIOD 40", "#define THERMAL_PROTECTION_BED_HYSTERESIS 4", "#define WATCH_BED_TEMP_PERIOD 20",
                     "// #define BED_MAXTEMP 260")),
    (MARLIN, None, ("// of a hot end; for a bed design with --assume heater=bed", "// #define HEATER_0_MAXTEMP 260"))])
def test_the_lines_are_of_the_heater_that_is_known(rule, heater, lines):
    text = lines_of(rule, [], {} if heater is None else {"heater": heater})[1].splitlines()
    assert set(lines) <= set(text)
    assert not any(other in " ".join(text) for other in ("extruder", *(("HEATER_0", "THERMAL_PROTECTION_PERIOD") if heater == "bed" else ())))
