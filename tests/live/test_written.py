"""Records of writes in the report: what stood in the virtual PLC, by OB251's manual, is what the page says."""

import json
import random
import shutil
from dataclasses import replace

import pytest
from tests.bench import records
from tests.bench.sessions import DEAD_S, LAG_S, TA_S, folder_in
from tests.report.test_record import _Seen

from heatertune import read_log
from heatertune.chain import encode, prove
from heatertune.chain.pipeline import redraw, write_report
from heatertune.cli import main
from heatertune.codec import read_document
from heatertune.errors import DocumentError
from heatertune.live.write.rollback import write_records
from heatertune.pid.design_document import read_design
from heatertune.proof.difference import WRITTEN_SCHEMA
from heatertune.proof.verdict import PROOF_SCHEMA
from heatertune.report.as_left_section import plot_watch


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A folder as `design` writes it, and the record of a write and its rollback; words and proof are those of export-db."""
    place = tmp_path_factory.mktemp("written")
    exported = folder_in(place)
    design, fitted, _ = read_design(exported / "pid.json")
    log, folder = place / "log.csv", place / "whole"
    rows = (f"{at},{22.0 + 0.001 * at:.2f},{at % 2}" for at in range(0, 900, 10))
    log.write_text("\n".join(["time_s,temperature_degC,power_pct", *rows]) + "\n")
    write_report(read_log(log), fitted, design, prove(encode(design, "s5-ob251"), fitted, setpoint_degC=50.0), folder)
    for name in ("words.json", "proof.json"):
        shutil.copy(exported / "data" / name, folder / "data" / name)
    (folder / "data" / "digest.json").unlink()  # as of an earlier release: these are documents of two designs
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("HEATERTUNE_STATE", str(place / "state"))
        return folder, records.record_in(folder).read_bytes()


@pytest.fixture
def record(made, tmp_path):
    """Write a record with its lines changed, and return what is made of it."""
    folder, content = made

    def told(change=lambda lines: lines, name="record.jsonl", end=b"\n"):
        lines = change([json.loads(line) for line in content.splitlines()])
        path = tmp_path / name
        path.write_bytes(b"\n".join(json.dumps(line).encode() for line in lines) + end)
        return write_records([path], folder)

    return told


def upto(step, before):
    """Return what keeps the lines up to the first of a step that comes after the first of another."""
    def change(lines):
        first = next(number for number, line in enumerate(lines) if line["step"] == before)
        return lines[:next(number for number, line in enumerate(lines) if number > first and line["step"] == step) + 1]

    return change


def test_a_write_and_its_rollback_are_as_found_as_proven_and_as_left(record):
    """OB251: K is K·R/1024² units per unit and TN is R·TA/TI (manual, table 11-11); words as the faults wrote them."""
    found = record()
    there, back = found.passages
    assert [(one.kind, one.outcome) for one in found.passages] == [("write", "done"), ("rollback", "done")]
    assert there.begun < there.ended <= back.begun
    assert (there.as_found["K"], there.left["K"], back.left["K"]) == (3000, 5431, 3000)
    k, tn = there.quantities[:2]
    assert (k.name, k.unit) == ("K", "%/°C")
    assert (k.as_found, k.proven, k.left) == pytest.approx((3000 / 1024, 5431 / 1024, 5431 / 1024))
    assert (tn.as_found, tn.left) == pytest.approx((1024 * TA_S / 30, 1024 * TA_S / 58))
    assert back.quantities[0].left == pytest.approx(3000 / 1024)
    watch = there.watch
    assert back.watch is None
    assert watch.time_s[-1] >= 5 * (LAG_S + DEAD_S)
    assert all(low < seen < high for low, seen, high in zip(watch.low_degC, watch.temperature_degC, watch.high_degC, strict=True))
    assert set(watch.setpoint_degC) == {1023 / 2047 * 100.0}


def test_a_record_of_the_schema_before_is_read(record):
    """Until 0.21.0 its sentences stood under `told`, also those of the checks in the first line."""
    def renamed(value):
        if isinstance(value, dict):
            return {"told" if key == "message" else key: renamed(item) for key, item in value.items()}
        return [renamed(item) for item in value] if isinstance(value, list) else value

    earlier = record(lambda lines: renamed([lines[0] | {"schema": "heatertune/write-record/1"}, *lines[1:]]), "earlier.jsonl")
    assert [replace(one, record="") for one in earlier.passages] == [replace(one, record="") for one in record().passages]
    assert earlier.passages[0].message
    assert earlier.passages[0].observations


def test_a_record_that_breaks_off_is_unknown_until_the_rollback_asked(record):
    cut = upto("written", "writing")
    [one] = record(cut).passages
    assert (one.outcome, one.ended, one.left) == ("unknown", None, None)
    assert one.message == "the record breaks off after the step 'written'; heatertune rollback record.jsonl asks the PLC"
    there, back = record(lambda lines: [*cut(lines), *lines[[line["step"] for line in lines].index("rollback"):]]).passages
    assert (there.outcome, there.ended, there.left["K"]) == ("unknown", None, 5431)
    assert there.quantities[0].left == pytest.approx(5431 / 1024)
    assert back.outcome == "done"


def test_a_torn_line_is_left_out_and_told(record):
    [*_, last] = record(end=b'\n{"step": "wat').passages
    assert last.notes == ("The last line of the record is torn, as a kill leaves it, and was left out.",)


def changed(step, **what):
    return lambda lines: [line | what if line["step"] == step else line for line in lines]


@pytest.mark.long
@pytest.mark.parametrize(("change", "told"), [
    (changed("begin", digest="sha256:0123456789abcdef"), "the record of another proof, 01234567; that in"),
    (lambda lines: changed("begin", before="ff" + lines[0]["before"][2:])(lines), "line 1: sha256: not the digest of what was there before"),
    (lambda lines: changed("begin", words=lines[0]["words"] | {"K": 1})(lines), "line 1: words.K: 1; in its proof 5431"),
    (changed("watched", temperature_degC="warm"), "temperature_degC: expected a number"),
    (changed("band", setpoint_degC=None), "setpoint_degC: expected a number"),
    (changed("end", outcome="fine"), "outcome: expected one of done"),
    (lambda lines: [line for line in lines if line["step"] != "band"], "without its band"),
    (lambda lines: [*lines, lines[1]], "comes after the end"),
    (lambda lines: lines[1:], "no record of a write"),
    (changed("rollback", at="monday"), "expected an instant"),
])
def test_a_record_that_is_another_or_damaged_is_refused_in_one_line(record, change, told):
    with pytest.raises(Exception, match=r"^[^\n]+$") as refused:
        record(change)
    assert told in str(refused.value)
    assert "record.jsonl" in str(refused.value)


def test_records_are_shown_or_refused_however_they_are_damaged(made):
    folder, content = made
    chance = random.Random(17)
    ways = {records.became(records.damaged(content, chance), folder) for _ in range(150)}
    assert ways == {"shown", "told"}


def test_no_reading_outside_of_the_band_is_thinned_away(record):
    def change(lines):
        at = [line["step"] for line in lines].index("watched")
        many = [lines[at] | {"s": 0.1 * number, "temperature_degC": 80.0 if number == 7777 else 50.0} for number in range(9000)]
        return [*lines[:at], *many, *lines[-1:]]

    watch = record(change).passages[0].watch
    assert len(watch.time_s) < 1600
    assert max(watch.temperature_degC) == 80.0
    assert "outside" in [line.get_label() for line in plot_watch(vars_of(watch)).axes[0].lines]


def vars_of(watch):
    return {name: getattr(watch, name) for name in watch.__slots__}


@pytest.fixture
def whole(made, tmp_path):
    """A copy of the folder with the record."""
    return shutil.copytree(made[0], tmp_path / "whole")


def test_the_page_tells_it_and_keeps_it(whole, capsys):
    digest = read_document(whole / "data" / "proof.json", PROOF_SCHEMA)["digest"]
    assert main(["report", str(whole), "--record", str(whole / "record.jsonl"), "--quiet"]) == 0
    shown = capsys.readouterr().out
    assert "2.93 %/°C -> 5.304 %/°C" in shown
    page = (whole / "report.html").read_text(encoding="utf-8")
    rows = _Seen(page[:page.index('<div class="appendix">')]).rows
    assert ["K", "2.93 %/°C", "5.304 %/°C", "5.304 %/°C"] in rows
    assert ["DW1 K", "KF +03000", "KF +05431", "KF +05431"] in rows
    assert ["DW1 K", "KF +05431", "KF +05431", "KF +03000"] in rows
    [words] = [row for row in rows if row[0] == "parameters" and len(row) == 3]
    assert words[1] == words[2], "as found, and after the rollback as left"
    assert words[1].startswith("K KF +03000, ")
    assert "Measured against proven" in page
    assert read_document(whole / "data" / "written.json", WRITTEN_SCHEMA)["digest"] == digest
    assert main(["report", str(whole), "--document", "HT-1", "--quiet"]) == 0
    assert "Measured against proven" in (whole / "report.html").read_text(encoding="utf-8")


@pytest.mark.parametrize(("named", "told"), [
    (("record.jsonl", "record.jsonl"), "is named twice"), (("nothing.jsonl",), "cannot be read"),
    (("data/proof.json",), "no step of a record"),
])
def test_what_is_no_record_is_one_line_and_the_page_stays(whole, named, told, capsys):
    before = (whole / "report.html").read_bytes()
    assert main(["report", str(whole), "--record", *(str(whole / name) for name in named), "--quiet"]) == 2
    [line] = capsys.readouterr().err.splitlines()
    assert told in line
    assert (whole / "report.html").read_bytes() == before


def test_a_write_that_did_not_end_well_is_exit_status_1(whole, capsys):
    lines = (whole / "record.jsonl").read_text().splitlines()
    (whole / "cut.jsonl").write_text("\n".join(lines[:4]) + "\n")
    assert main(["report", str(whole), "--record", str(whole / "cut.jsonl"), "--quiet"]) == 1
    assert "UNKNOWN" in capsys.readouterr().out


def test_a_document_of_no_passage_is_refused(whole):
    (whole / "data" / "written.json").write_text(json.dumps({"schema": WRITTEN_SCHEMA, "digest": "", "passages": []}))
    with pytest.raises(DocumentError, match=r"written\.json: passages: none"):
        redraw(whole)
