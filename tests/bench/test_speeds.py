"""The manual's table of speeds has the form of the one that `python -m tests.bench.speeds` prints; values are its own."""

import re
import sys
from pathlib import Path

import pytest

from tests.bench import speeds

PAGE = (Path(__file__).parents[2] / "docs" / "reference" / "speed.md").read_text(encoding="utf-8")
TABLE = PAGE[PAGE.index(speeds.HEAD) + len(speeds.HEAD):].split("\n\n")[0].strip().splitlines()


def test_the_manual_holds_the_rows_that_the_command_measures_and_no_others():
    assert len(TABLE) == len(speeds.ROWS)
    for line, row in zip(TABLE, speeds.ROWS, strict=True):
        assert re.fullmatch(row.form(), line), f"{line}\nis not\n{row.form()}"
    assert "python -m tests.bench.speeds" in PAGE


@pytest.mark.parametrize("row", speeds.ROWS, ids=lambda row: row.what)
def test_what_the_command_prints_has_its_own_form(row):
    count = (row.ours + row.beside).count("{}")
    given = speeds.Row(row.what, row.ours, row.beside, row.by, lambda: [1234.5 / 7.0 ** n for n in range(count)])
    assert re.fullmatch(row.form(), given.told())
    assert not re.fullmatch(row.form(), given.told().replace("|", "| many", 2)), "the form would see nothing"


@pytest.mark.parametrize(("value", "told"), [(0.0347, "0.035"), (1.04, "1"), (9.96, "10"), (34.9, "35"), (29123.0, "29,000")])
def test_figures_have_two_digits(value, told):
    assert speeds.figure(value) == told


def test_rows_can_be_asked_for_by_a_word(monkeypatch, capsys):
    monkeypatch.setattr(sys, "argv", ["speeds", "argparse", "--help"])
    speeds.main()
    head, row = capsys.readouterr().out.rsplit("\n", 2)[0:2]
    assert head == speeds.HEAD
    assert re.fullmatch(speeds.ROWS[-1].form(), row)
