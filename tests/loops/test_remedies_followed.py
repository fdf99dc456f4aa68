"""What `health` names as a way on for a loop that heats and cools is typed as it stands, and works. Days of the bench's own rig."""

import re
from pathlib import Path

import numpy as np
import pytest
from tests.bench.cooled_health import day, drawn

from heatertune.cli import main
from heatertune.log import read_log
from heatertune.loops.diagnosis import cure_words, diagnose
from heatertune.loops.measures import LoopEntry


def write(path, log, cooling):
    """Write a log as a CSV file with a column of its cooler."""
    columns = (log.time_s, log.temperature_degC, log.power_pct, cooling, log.setpoint_degC)
    rows = (f"{t:g},{y:.1f},{u:g},{c:g},{w:g}" for t, y, u, c, w in zip(*columns, strict=True))
    Path(path).write_text("\n".join(["time [s],T [°C],power [%],cooling [%],setpoint [°C]", *rows]) + "\n", encoding="utf-8")


@pytest.mark.long
def test_a_loop_whose_cooler_the_log_does_not_show_is_judged_without_its_power(tmp_path, capsys):
    log = day(drawn(20), "as before", 20)
    idle = np.flatnonzero(np.asarray(log.power_pct) == 0.0)
    cooling = np.zeros(len(log.time_s))
    cooling[idle[idle > 600][:2]] = 1.0  # two rows at 1 %
    (folder := tmp_path / "logs").mkdir()
    write(folder / "hot.csv", log, cooling)
    line = ["health", str(folder), "--target", "pid-temp", "--range", "0", "200", "-o", str(tmp_path / "h.html")]
    main([*line, "--json"])
    said = capsys.readouterr().out
    assert "does not show how strong the cooler is" in said
    remedy = re.search(r"by its temperature alone: (--power-column none)", said)[1].split()
    main([*line, *remedy, "--json"])
    said = capsys.readouterr().out
    assert "does not show how strong" not in said
    assert '"left_out": []' in said


@pytest.mark.long(60)
def test_a_loop_that_heats_and_cools_and_swings_is_designed_as_the_advice_says(tmp_path):
    write(path := tmp_path / "swings.csv", log := day(drawn(20), "swings", 20), log.cooling_pct)
    entry = LoopEntry(name="swings", file=str(path))
    cure = cure_words(diagnose(read_log(path), entry), entry, None)
    command = re.search(r"heatertune (design LOG --target pid-temp --cooling-gain \S+)$", cure.reason)[1]
    line = [str(path) if word == "LOG" else word for word in command.split()]
    assert main([*line, "-o", str(tmp_path / "out"), "--quiet"]) == 0
    assert (tmp_path / "out" / "pid_temp_words.scl").is_file()
