"""The words are the same wherever they are shown; expected values from table 11-10, COMMISSIONING.md and by hand."""

import csv
import re
from types import SimpleNamespace

import pytest
from tests.report.screens import documents_of
from tests.report.test_record import _Seen

from heatertune.errors import InputError
from heatertune.pid.design_values import PidDesign
from heatertune.plc import NAMES, Certificate, Ramp, Scaling, Words, controller_for
from heatertune.plc.dump_reader import read_machine
from heatertune.plc.keyed_entry import setpoint_entry, typed_table, typed_words
from heatertune.proof.words_file import certificate, words_of
from heatertune.report.page import record
from heatertune.report.report_text import words_table
from heatertune.report.verdict_summary import design_brief
from heatertune.studio import views

OB251 = controller_for("s5-ob251")


def _listing(text):
    """Return name → first, then, meaning of a listing to key in."""
    row = re.compile(r" *\d+:  (\w\w) = ([^;]+); +(?:\1 = ([^;]+);)? +([A-Z]\w*) (.+)")
    return {name: (first, then or first, meaning) for _, first, then, name, meaning in row.findall(text)}


def _typed(cell):
    """Return a cell as a listing has it, whose format stands in a column of its own."""
    return cell.removeprefix("KM ").removeprefix("KF ")


def _rows(cells):
    """Return the studio's rows likewise: address, name, type, first, then, meaning, with a button beside each value."""
    return {name: (_shown(first), _shown(then) or _shown(first), meaning) for _, name, _, first, then, meaning in cells}


def _shown(cell):
    return re.sub(r"^K[FM] |Copy$", "", cell.strip()).strip()


def _in_turn(cell):
    """Return what is typed first and then of a cell such as "first KF +00200 then KF +00000"."""
    first, then = re.fullmatch(r"(?:first (.*) then )?(.*)", cell).groups()
    return tuple(each.removeprefix("KF ").removeprefix("KM ") for each in (first or then, then))


@pytest.mark.long
def test_listing_table_terminal_studio_and_report_show_the_same_words(documents):
    document = documents["words"]
    words = words_of(document, "s5-ob251", "words.json")
    files = OB251.export(words, certificate(documents["proof"]))
    listed = _listing(files["DB30_listing.txt"])
    used = {name: listed[name] for name in words.values}
    assert used["W"] == ("+00818", "+00818", "setpoint, DW 0 of DB31: 40 °C as proven; others: whole part of (2047/100)·(°C - 0)")
    assert used["STEU"][:2] == ("00000000 00100000", "00000000 00100001")  # bit 0: automatic, bit 5: no Z
    assert used["YH"][:2] == ("+00200", "+00000")
    assert used["K"][:2] == (f"{words.values['K']:+06d}",) * 2
    table = [row for row in csv.reader(files["DB30.csv"].splitlines()) if row[-1].partition(" ")[0] in words.values]
    plain = str.maketrans({"°": "deg", "·": "*"})  # a table is ASCII: what opens it may take it for another code page
    assert {row[4].partition(" ")[0]: (row[2], row[3], row[4].partition(" ")[2]) for row in table} == {
        name: (first, then, meaning.translate(plain)) for name, (first, then, meaning) in used.items()}
    terminal = [re.split(r" {2,}", line) for line in words_table(document).splitlines() if line.startswith("DW")]
    assert {name: _typed(first) for _, name, first, *_ in terminal} == {name: first for name, (first, *_) in used.items()}
    assert {row[1]: _typed(row[3]) for row in terminal if len(row) == 5} == {
        name: then for name, (first, then, _) in used.items() if then != first}
    assert {row[1]: row[-1] for row in terminal} == {name: meaning for name, (*_, meaning) in used.items()}
    look = SimpleNamespace(gains=SimpleNamespace(words=words), proof=SimpleNamespace(scenario=SimpleNamespace(setpoint_degC=40.0)))
    assert _rows(_Seen(views.words(look)).rows[1:]) == used
    reported = [row for row in _Seen(record(documents)).rows if row[1].startswith("DW")]
    assert {row[1].split()[1]: (*_in_turn(row[2]), row[3]) for row in reported} == used


@pytest.mark.parametrize(("span", "setpoint", "w"), [(100.0, 53.3, 1091), (100.0, 40.0, 818), (200.0, 40.0, 409)])
def test_w_is_the_proven_setpoint_cut_to_units(span, setpoint, w):
    """2047·53.3/100 = 1091.05, 2047·40/100 = 818.8, 2047·40/200 = 409.4: the proof's input module cuts, it does not round."""
    row = next(row for row in typed_words(_words(high_degC=span), setpoint) if row.name == "W")
    assert (row.first, row.then) == (w, w)


def test_w_stays_as_it_is_without_a_proof_and_where_a_ramp_leads_it():
    ramped = typed_words(_words(ramp=Ramp(step=4)), 53.3)
    for rows, part in ((typed_words(_words()), "enter yours there"), (ramped, "DW 0 of DB31 = +1091: 53.3 °C as proven"),
                       (typed_words(_words(ramp=Ramp(step=4))), "DW 0 of DB31: ")):
        w = next(row for row in rows if row.name == "W")
        assert (w.first, w.then) == (0, 0)
        assert part in w.meaning


def test_yh_begins_within_the_limits():
    rows = {row.name: row for row in typed_words(_words(BGOG=150))}
    assert (rows["YH"].first, rows["YH"].then) == (150, 0)


def test_the_head_of_the_listing_says_what_the_image_holds():
    listing = OB251.export(_words(), Certificate(verdict="PASS", setpoint_degC=53.3))["DB30_listing.txt"]
    assert "DB30.bin holds the words of automatic, W = +00000" in listing


def test_a_listing_is_read_back_as_what_is_typed_for_automatic():
    listing = OB251.export(_words(), Certificate(verdict="PASS", setpoint_degC=53.3))["DB30_listing.txt"]
    read = read_machine(OB251, listing.encode(), sample_time_s=1.0, scaling=Scaling(), source="listing").words
    assert read == _words(W=1091)


@pytest.mark.parametrize(("right", "damaged"), [("KM = 00000000 00100000;", "KM = 00000000 001000x0;"),
                                                ("KM = 00000000 00100001", "KM = 00000000 0010001")])
def test_a_damaged_constant_of_either_column_is_refused_by_its_line(right, damaged):
    listing = OB251.export(_words(), Certificate(verdict="PASS", setpoint_degC=53.3))["DB30_listing.txt"]
    assert listing.count(right) == 1
    line = next(number for number, text in enumerate(listing.splitlines(), 1) if right in text)
    with pytest.raises(InputError, match=rf"listing, line {line}, DW11: .*expected KM, 16 bits"):
        read_machine(OB251, listing.replace(right, damaged).encode(), sample_time_s=1.0, scaling=Scaling(), source="listing")


def test_words_that_are_typed_once_stand_in_one_column():
    weg = controller_for("weg").encode(PidDesign(gain_pct_per_degC=3.0, integral_time_s=200.0, derivative_time_s=0.0,
                                                 sample_time_s=1.0, structure="pi", method=""), Scaling())
    table = typed_table(typed_words(weg, 40.0))
    assert (table.heads, table.values) == (("address", "word", "value", "meaning"), (2,))


def _words(ramp=None, high_degC=100.0, **changed):
    values = {"K": 1024, "R": 1024, "TI": 20, "TD": 0, "W": 0, "STEU": 33, "YH": 0, "BGOG": 2047, "BGUG": 0} | changed
    return Words(target="s5-ob251", values=values, scaling=Scaling(high_degC=high_degC), sample_time_s=1.0, ramp=ramp)


@pytest.mark.parametrize("target", NAMES)
def test_screen_and_record_show_each_word_as_it_is_entered_and_name_the_same_file_first(target):
    documents = documents_of(target, "PASS")
    documents["log"] = {"name": "log"}
    documents["proof"] |= {"digest": "sha256:0", "interlock": None}
    document = documents["words"]
    page, rows = record(documents), typed_words(words_of(document, target, "words.json"), document["setpoint_degC"])
    seen = {row[1].split()[-1]: row[2] for row in _Seen(page).rows if len(row) == 4 and row[1]}
    screen, text = design_brief(documents, "out"), " ".join(re.sub(r"<[^>]+>", " ", page).split())
    for row in rows:
        shown = seen[row.name].removeprefix("first ")
        assert shown.removesuffix(row.format).split(" then ")[-1].strip() == row.then_text
        assert f" {row.then_text}" in " ".join(screen.split())
        assert f"{row.name} {row.then_text}" in text  # as left
    main = controller_for(target).main_file
    assert f"out/{main}" in screen
    assert re.search(rf"File for the \w+: {re.escape(main)}( ;|$| )", text)
    assert f"enter {setpoint_entry(words_of(document, target, 'words.json'), document['setpoint_degC'])}." in text
