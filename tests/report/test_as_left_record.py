"""A trace beside a folder, as the command line takes it, and the record that it fills in."""

import json

import numpy as np
import pytest
from tests.report.test_record import _Seen

from heatertune.chain.pipeline import as_left_in, files_of, related_documents
from heatertune.cli import main
from heatertune.codec import data_folder, encode, existing_path, plain, to_json
from heatertune.log import read_log


def _write(folder, documents):
    folder.mkdir(parents=True, exist_ok=True)
    for name, document in documents.items():
        (folder / f"{name}.json").write_text(to_json(document), encoding="utf-8")


@pytest.fixture
def trace(tmp_path, documents):
    """The nominal run of the proof's own pictures as an export, 30 s of rest before it."""
    run = documents["pictures"]["nominal"]
    time = np.arange(0.0, 900.0, 3.0)
    temperature = np.interp(time, run["time_s"], run["temperature_degC"])
    rows = [f"{at};{temperature[0]:.2f};0" for at in range(0, 30, 3)]
    rows += [f"{at + 30:g};{reading:.2f};40" for at, reading in zip(time, temperature, strict=True)]
    path = tmp_path / "trace.csv"
    path.write_text("time [s];temperature [°C];setpoint [°C]\n" + "\n".join(rows) + "\n", encoding="utf-8")
    return path


def _measured(folder):
    page = (folder / "report.html").read_text(encoding="utf-8")
    rows = _Seen(page[:page.index('<div class="appendix">')]).rows
    return page, {row[1]: row[4] for row in rows if len(row) == 6}


@pytest.mark.long
@pytest.mark.parametrize("inner", ["data", "."])
def test_a_trace_fills_the_record_in_and_stays_in_it(tmp_path, documents, trace, inner, capsys):
    """Also in a folder of an earlier release, whose documents lie beside the report."""
    folder = tmp_path / "out"
    _write(folder / inner, documents)
    assert main(["report", str(folder), "--as-left", str(trace), "--plant-tag", "TIC-1 & <b>", "--quiet"]) == 0
    assert capsys.readouterr().out.startswith("AS PROVEN  trace beside s5-ob251 at 40 °C")
    kept = json.loads((folder / inner / "as_left.json").read_text())
    told = {line["name"]: line["measured"] for line in kept["measurements"]}
    assert main(["report", str(folder), "--document", "HT-1", "--quiet"]) == 0
    page, measured = _measured(folder)
    assert measured["overshoot"] == f"{told['overshoot']:.3g} % of rise"
    assert measured["recovery time"] == "", "by hand: the trace has no load"
    assert "TIC-1 &amp; &lt;b&gt;" in page
    assert "<dd>HT-1</dd>" in page
    assert "The trace and the band of the proven runs" in page


def test_a_trace_of_another_proof_is_not_shown(tmp_path, documents, trace):
    _write(tmp_path / "data", documents)
    held = {"as_left": plain(encode(as_left_in(tmp_path, documents, read_log(trace))))}
    assert files_of(tmp_path, held) == {"data/as_left.json": to_json(held["as_left"])}
    _write(tmp_path / "data", held)
    assert related_documents(tmp_path, documents["proof"]) == held
    assert related_documents(tmp_path, documents["proof"] | {"digest": "sha256:0"}) == {}


@pytest.mark.parametrize(("options", "told"), [
    (("--load-at", "5"), "need --as-left TRACE"), (("--as-left", "nothing.csv"), "nothing.csv"),
    (("--as-left", "{trace}", "--setpoint", "22"), "no heat-up"), (("--as-left", "{trace}", "--load-at", "9e9"), "--load-at"),
    (("--as-left", "{trace}", "--setpoint", "2000"), "2000"),
])
def test_what_cannot_be_judged_is_one_line(tmp_path, documents, trace, options, told, capsys):
    folder = tmp_path / "out"
    _write(folder / "data", documents)
    assert main(["report", str(folder), *(each.format(trace=trace) for each in options), "--quiet"]) == 2
    said = capsys.readouterr().err.splitlines()
    assert len([line for line in said if not line.startswith("[log]")]) == 1
    assert told in said[-1]
    assert not (folder / "report.html").exists()


def test_documents_are_found_where_they_lie(tmp_path):
    assert data_folder(tmp_path) == tmp_path
    (tmp_path / "data").mkdir()
    assert data_folder(tmp_path) == tmp_path, "a folder of that name with other things in it"
    (tmp_path / "data" / "words.json").write_text("{}")
    assert data_folder(tmp_path) == tmp_path / "data"
    assert existing_path(tmp_path / "words.json") == tmp_path / "data" / "words.json"
    (tmp_path / "words.json").write_text("{}")
    assert existing_path(tmp_path / "words.json") == tmp_path / "words.json"
