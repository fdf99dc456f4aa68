import dataclasses
import json
import math
import os
import random
import subprocess
import sys
from concurrent.futures import wait

import pyarrow.parquet
import pytest
from tests.chain.batch_work import COLUMNS, batch_of, expected_row
from tests.conftest import ROOT

from heatertune.batch import Chunk, in_processes, run
from heatertune.batch import engine as parts
from heatertune.batch import engine as processes
from heatertune.batch import engine as table
from heatertune.errors import DocumentError, InputError, OutOfRange


def at_once(chunks, do):
    """Workers that do everything here and now, the last chunk first: the order must not matter."""
    for chunk in reversed(list(chunks)):
        yield chunk, do(chunk.cases)


def rows_of(path):
    return pyarrow.parquet.read_table(path).to_pylist()


@pytest.fixture
def out(tmp_path):
    return tmp_path / "table.parquet"


def test_the_table_holds_every_case_once_in_order_with_its_meaning(out):
    told = []
    summary = run(batch_of(7), out, workers=at_once, progress=lambda done, total: told.append((done, total)))
    assert rows_of(out) == [expected_row(k) for k in range(7)]  # worked out without the engine
    assert summary == {
        "table": str(out), "rows": 7, "outcomes": {"FAIL": 3, "PASS": 4},
        "examples": {"FAIL": [{"name": f"n{k}", "reason": "odd"} for k in (1, 3, 5)]},
    }
    schema = pyarrow.parquet.read_schema(out)
    assert {field.name: field.metadata[b"what"].decode() for field in schema} == {c.name: c.description for c in COLUMNS}
    assert [str(field.type) for field in schema] == ["string", "string", "string", "double", "int64"]
    assert told[0] == (0, 7)
    assert told[-1] == (7, 7)
    assert [path.name for path in out.parent.iterdir()] == [out.name], "nothing is left beside the table"


def test_no_more_than_three_examples_of_an_outcome_are_told(out):
    summary = run(batch_of(20), out, workers=at_once)
    assert summary["outcomes"] == {"FAIL": 10, "PASS": 10}
    assert [each["name"] for each in summary["examples"]["FAIL"]] == ["n1", "n3", "n5"]


def test_numbers_that_are_not_finite_reach_the_table_as_they_are(out):
    batch = batch_of(3)

    def odd_numbers(chunks, do):
        for chunk in chunks:
            yield chunk, [row | {"root": value} for row, value in zip(do(chunk.cases), (math.inf,), strict=True)]

    run(batch, out, workers=odd_numbers)
    assert [row["root"] for row in rows_of(out)] == [math.inf] * 3


@pytest.mark.parametrize("total", [1, 15, 16, 17, 35])
def test_chunks_of_many_cases_are_cut_without_loss(out, monkeypatch, total):
    monkeypatch.setattr(parts, "_MANY", 1)  # so that 16 cases make a chunk
    sizes = []

    def counted(chunks, do):
        for chunk in chunks:
            sizes.append(len(chunk.cases))
            yield chunk, do(chunk.cases)

    run(batch_of(total), out, workers=counted)
    assert rows_of(out) == [expected_row(k) for k in range(total)]
    assert sum(sizes) == total
    assert max(sizes) <= 16


def test_row_groups_are_streamed_and_no_row_gets_lost_between_them(out, monkeypatch):
    monkeypatch.setattr(table, "_GROUP", 4)
    run(batch_of(10), out, workers=at_once)
    found = pyarrow.parquet.ParquetFile(out)
    assert [found.metadata.row_group(k).num_rows for k in range(found.num_row_groups)] == [4, 4, 2]
    assert rows_of(out) == [expected_row(k) for k in range(10)]


def stopped_after(number):
    """Workers that are stopped by an error after so many chunks."""
    def workers(chunks, do):
        for k, chunk in enumerate(chunks):
            if k == number:
                raise KeyboardInterrupt
            yield chunk, do(chunk.cases)
    return workers


def test_what_was_done_is_not_done_again_and_the_bytes_are_the_same(out, tmp_path):
    whole = tmp_path / "whole.parquet"
    run(batch_of(9), whole, workers=at_once)
    with pytest.raises(KeyboardInterrupt):
        run(batch_of(9), out, workers=stopped_after(4))
    assert not out.exists()
    again, told = [], []

    def watched(chunks, do):
        for chunk in chunks:
            again.append(chunk.start)
            yield chunk, do(chunk.cases)

    run(batch_of(9), out, workers=watched, resume=True, progress=lambda done, _: told.append(done))
    assert again == [4, 5, 6, 7, 8]
    assert told[0] == 4, "what an earlier run did is told at once"
    assert out.read_bytes() == whole.read_bytes()


def test_a_finished_table_is_left_alone_by_resume_and_made_anew_without_it(out):
    first = run(batch_of(5), out, workers=at_once)

    def nobody(chunks, do):
        raise AssertionError

    assert run(batch_of(5), out, workers=nobody, resume=True) == first
    with pytest.raises(AssertionError):
        run(batch_of(5), out, workers=nobody)


def test_the_finished_table_of_another_batch_is_not_taken_for_this_one(out):
    run(batch_of(5), out, workers=at_once)
    assert run(batch_of(6), out, workers=at_once, resume=True)["rows"] == 6


def test_parts_are_neither_overwritten_nor_mixed_with_those_of_another_run(out):
    with pytest.raises(KeyboardInterrupt):
        run(batch_of(9), out, workers=stopped_after(4))
    with pytest.raises(InputError, match="continue it with --resume"):
        run(batch_of(9), out, workers=at_once)
    with pytest.raises(InputError, match="with different number; repeat the options of that run"):
        run(batch_of(8), out, workers=at_once, resume=True)
    assert run(batch_of(9), out, workers=at_once, resume=True)["rows"] == 9


def part_of(out, number):
    return next(out.with_name(f"{out.name}.parts").glob(f"{number:09d}-*.jsonl"))


def test_what_has_changed_since_it_was_done_is_done_again_and_nothing_else(out):
    """A part is of what its case held when it was sent: `held` stands for the contents of files."""
    held = list(range(6))
    batch = dataclasses.replace(batch_of(6), sent=held.__getitem__)
    with pytest.raises(KeyboardInterrupt):
        run(batch, out, workers=stopped_after(4))
    held[1] = 10
    again = []

    def watched(chunks, do):
        for chunk in chunks:
            again.append(chunk.start)
            yield chunk, do(chunk.cases)

    assert run(batch, out, workers=watched, resume=True)["done_again"] == 1
    assert again == [1, 4, 5]
    assert [row["name"] for row in rows_of(out)] == ["n0", "n10", "n2", "n3", "n4", "n5"]
    held[5] = 12
    assert run(batch, out, workers=at_once, resume=True)["rows"] == 6
    assert [row["name"] for row in rows_of(out)][5] == "n12", "a finished table of other contents is another table"


def test_a_row_may_hold_anything_that_breaks_lines_elsewhere(out):
    """U+2028, U+0085 and a form feed end a line for `str.splitlines`, not for a part."""
    odd = "a\u2028b\x85c\x0cd\re\nf\udcff"

    def named(chunks, do):
        for chunk in chunks:
            yield chunk, [row | {"reason": odd} for row in do(chunk.cases)]

    run(batch_of(3), out, workers=named)
    assert [row["reason"] for row in rows_of(out)] == [odd.replace("\udcff", "\\udcff")] * 3


HOLDER = """
import sys
from pathlib import Path
from heatertune.batch.engine import hold_lock
with hold_lock(Path(sys.argv[1])):
    print("held", flush=True)
    sys.stdin.read()
"""


def test_of_two_runs_on_one_table_the_second_is_refused_and_a_dead_ones_lock_is_taken(out):
    """The first is a real process that holds the lock until it is killed."""
    with subprocess.Popen([sys.executable, "-c", HOLDER, str(out)], stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                          text=True) as first:
        assert first.stdout.readline() == "held\n"
        with pytest.raises(InputError, match=rf"another run is writing it \(process {first.pid}\)") as refused:
            run(batch_of(3), out, workers=at_once)
        first.kill()
        first.wait(timeout=30.0)
    assert "\n" not in str(refused.value)
    assert (out.parent / f".{out.name}.lock").exists(), "left by the dead one"
    assert run(batch_of(3), out, workers=at_once)["rows"] == 3
    assert [path.name for path in out.parent.iterdir()] == [out.name]


@pytest.mark.parametrize("content", ["", '{"name": "n2', '{"name": "n2"}'])
def test_a_part_that_a_power_cut_left_unfinished_is_made_again(out, content):
    with pytest.raises(KeyboardInterrupt):
        run(batch_of(5), out, workers=stopped_after(4))
    part_of(out, 2).write_text(content)
    run(batch_of(5), out, workers=at_once, resume=True)
    assert rows_of(out) == [expected_row(k) for k in range(5)]


def test_a_part_that_is_no_part_is_named(out):
    with pytest.raises(KeyboardInterrupt):
        run(batch_of(5), out, workers=stopped_after(4))
    part_of(out, 2).write_text('{"name": "n2"}}\n')
    with pytest.raises(DocumentError, match=r"000000002-\w+.jsonl: not a valid part of a table; remove it"):
        run(batch_of(5), out, workers=at_once, resume=True)


def test_a_batch_without_cases_and_a_pool_without_processes_are_refused(out):
    with pytest.raises(InputError, match="there are no cases to run"):
        run(batch_of(0), out, workers=at_once)
    with pytest.raises(OutOfRange, match="jobs = 0 is out of range: must be >= 1"):
        in_processes(0)


def test_a_table_that_cannot_be_written_is_told_in_one_line(out):
    out.mkdir()
    (out / "in the way").touch()
    with pytest.raises(InputError, match="cannot be written"):
        run(batch_of(3), out, workers=at_once)


def test_without_pyarrow_the_extra_is_named_before_any_work(out, monkeypatch):
    monkeypatch.setitem(sys.modules, "pyarrow", None)
    with pytest.raises(InputError, match=r"pip install 'heatertune\[fleet\]'"):
        run(batch_of(3), out, workers=at_once)
    assert not list(out.parent.iterdir())


def test_a_worker_with_another_program_is_refused(out, monkeypatch):
    def elsewhere(chunks, do):
        for chunk in chunks:
            with monkeypatch.context() as there:
                there.setattr("heatertune.batch.engine._program", lambda: "heatertune 0")
                yield chunk, do(chunk.cases)

    with pytest.raises(InputError, match=r"a worker runs a different program \(heatertune 0.*; expected heatertune"):
        run(batch_of(3), out, workers=elsewhere)


@pytest.mark.long
def test_any_number_of_processes_writes_the_same_bytes_one_thread_each(out, tmp_path, monkeypatch):
    monkeypatch.setenv("OMP_NUM_THREADS", "7")
    monkeypatch.delenv("NUMBA_NUM_THREADS", raising=False)
    run(batch_of(12), out, workers=at_once)
    seen = []
    for jobs in (1, 3):
        path = tmp_path / f"{jobs}.parquet"
        run(batch_of(12), path, workers=in_processes(jobs),
            progress=lambda done, _: seen.append((os.environ["OMP_NUM_THREADS"], done)))
        assert path.read_bytes() == out.read_bytes()
    assert ("1", 12) in seen
    assert os.environ["OMP_NUM_THREADS"] == "7"
    assert "NUMBA_NUM_THREADS" not in os.environ


@pytest.mark.long
def test_a_process_that_is_killed_takes_no_case_along(out, tmp_path):
    flag = tmp_path / "flag"
    flag.touch()
    summary = run(batch_of(12, deadly_once={5: str(flag)}), out, workers=in_processes(2))
    assert not flag.exists(), "the process did die"
    assert summary["outcomes"] == {"FAIL": 6, "PASS": 6}
    assert rows_of(out) == [expected_row(k) for k in range(12)]


@pytest.mark.long
def test_chunks_whose_end_is_not_heard_of_when_a_process_dies_are_done_again(out, tmp_path, monkeypatch):
    def one_by_one(futures, **_):
        done, _ = wait(futures)
        return {next(future for future in futures if future in done)}, set()

    monkeypatch.setattr(processes, "wait", one_by_one)
    flag = tmp_path / "flag"
    flag.touch()
    run(batch_of(6, deadly_once={1: str(flag)}), out, workers=in_processes(2))
    assert rows_of(out) == [expected_row(k) for k in range(6)]


@pytest.mark.long
def test_a_case_that_kills_every_process_is_a_row_and_its_neighbours_are_done(out, monkeypatch):
    monkeypatch.setattr(parts, "_MANY", 1)  # chunks of up to 16: the deadly case has neighbours in its own
    summary = run(batch_of(6, always_deadly=[3]), out, workers=in_processes(2))
    assert summary["outcomes"] == {"FAIL": 2, "PASS": 3, "crashed": 1}
    rows = rows_of(out)
    assert rows[3]["reason"] == "every process that worked on it died (out of memory?)"
    assert [row for k, row in enumerate(rows) if k != 3] == [expected_row(k) for k in (0, 1, 2, 4, 5)]


def test_workers_may_lose_a_chunk_for_good_or_only_together(out, monkeypatch):
    monkeypatch.setattr(parts, "_MANY", 1)
    given = []

    def forgetful(chunks, do):
        for chunk in chunks:
            given.append(chunk)
            yield chunk, None if len(chunk.cases) > 1 or chunk.cases == [2] else do(chunk.cases)

    assert run(batch_of(4), out, workers=forgetful)["outcomes"] == {"FAIL": 2, "PASS": 1, "crashed": 1}
    assert given == [Chunk(0, [0, 1, 2, 3]), *(Chunk(k, [k]) for k in range(4))]


@pytest.mark.long
def test_killed_twenty_times_at_random_it_does_nothing_twice_and_writes_the_same_bytes(out, tmp_path):
    number, whole, diary = 300, tmp_path / "whole.parquet", tmp_path / "diary"
    run(batch_of(number), whole, workers=at_once)
    diary.touch()
    told = {"number": number, "out": str(out), "jobs": 2, "shared": {"seconds": 0.01, "diary": str(diary)}}
    command = [sys.executable, "-m", "tests.chain.batch_work", json.dumps(told)]
    chance, kills, folder = random.Random(6), 0, out.with_name(f"{out.name}.parts")
    while kills < 20 and not out.exists():
        finished = {int(path.stem[:9]) for path in folder.glob("[0-9]*.jsonl")}
        before = len(diary.read_text())
        process = subprocess.Popen(command, cwd=ROOT, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL)
        try:
            process.communicate(timeout=chance.uniform(0.2, 0.9))
        except subprocess.TimeoutExpired:
            process.kill()
            process.communicate(timeout=60.0)  # the end of the file: its processes have ended, too
            kills += 1
        assert not finished & set(map(int, diary.read_text()[before:].split())), "done twice"
    assert kills >= 5, "it was too quick to be killed"
    subprocess.run(command, cwd=ROOT, check=True)
    assert out.read_bytes() == whole.read_bytes()
    assert set(map(int, diary.read_text().split())) == set(range(number))
