"""A design folder whose documents leave out what their schema lets them: the report reads it as what it stands for."""

import json
import shutil

import pytest

from heatertune.cli import main


@pytest.mark.long
@pytest.mark.parametrize(("name", "place"), [
    ("comparison", "rivals.0.integral_time_s"), ("comparison", "rivals.0.gain_pct_per_degC"), ("comparison", "paper"),
    ("words", "realised.derivative_time_s"), ("words", "search"), ("model", "hypotheses.0.hold_out_rmse_degC"),
    ("model", "hypotheses.0.on_bound"), ("model", "candidates.0.ambient_degC"), ("pid", "robust"), ("pid", "notes"),
])
def test_a_document_without_a_field_is_drawn_or_refused_in_one_line(main_job, tmp_path, capsys, name, place):
    copy = tmp_path / "out"
    shutil.copytree(main_job[0], copy)
    path = copy / "data" / f"{name}.json"
    document = json.loads(path.read_text(encoding="utf-8"))
    *way, last = [int(step) if step.isdecimal() else step for step in place.split(".")]
    inner = document
    for step in way:
        inner = inner[step]
    del inner[last]
    path.write_text(json.dumps(document), encoding="utf-8")
    status = main(["report", str(copy), "--quiet"])
    complaint = capsys.readouterr().err
    assert status in (0, 1) or (status == 2 and f"{name}.json" in complaint), complaint
