"""A small cut of `tests/bench/fuzz.py`, which throws tens of thousands."""

import random

import pytest

from tests.bench import fuzz
from tests.bench.documents import write_all


@pytest.fixture(scope="module")
def base(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fuzz")
    (folder / "base").mkdir()
    write_all(folder / "base")
    return folder


@pytest.mark.long
@pytest.mark.parametrize(("kind", "count"), [("logs", 150), ("documents", 100), ("options", 100)])
def test_whatever_is_thrown_is_taken_or_refused_in_one_line(kind, count, base):
    tallies = fuzz.attack(base, {kind: count}, seed=0, deep=False)
    assert not tallies[kind].faults, "\n".join(fuzz.lines_of(tallies))
    assert tallies[kind].ends["refused"] > count / 5


@pytest.mark.long
def test_odd_files_are_refused_without_waiting(base, monkeypatch):
    monkeypatch.chdir(base)
    for number, make in enumerate(fuzz._ODD_FILES):
        folder = base / f"odd{number}"
        folder.mkdir()
        path = make(folder, random.Random(number))
        with fuzz.doors(clock := fuzz.Clock()):
            end, where = fuzz.outcome(fuzz.Case(["read", "--quiet", "--", str(path)]), clock)
        assert end in ("accepted", "refused"), (path, end, where)
