"""Machine code on disk: found again, never taken for that of a changed program, removed when nobody uses it."""

import importlib.util
import os
import shutil
import sys
import time
from collections import Counter
from threading import Barrier, Event, Thread

import numpy as np
import pytest

from heatertune import compiled as machine
from heatertune.compiled import compiled, machine_code

SOURCE = """
from heatertune.units import kelvin_to_degC

FACTOR = {factor}

def inner(x):
    return {inner}

def outer(x):
    return FACTOR * inner(x)

def many(n):
    out = np.zeros(n)
    for i in range(n):
        out[i] = outer(float(i))
    return out
"""


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.setattr(machine, "folder", lambda: tmp_path / "cache")
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # Python's own cache tells no change within a second of equal length
    return tmp_path / "cache"


def _started_anew(tmp_path, factor=2.0, inner="x + 1.0"):
    """The functions as a new process would have them: another module object from the same file."""
    path = tmp_path / "own.py"
    text = "import numpy as np\n" + SOURCE.format(factor=factor, inner=inner)
    if not path.exists() or path.read_text() != text:
        path.write_text(text)
    spec = importlib.util.spec_from_file_location("own", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def _hits(door):
    return sum(door.stats.cache_hits.values())


def test_what_is_compiled_is_found_by_the_next_process(tmp_path, place):
    first, second = (compiled(_started_anew(tmp_path).outer) for _ in range(2))
    assert first(3.0) == 8.0
    assert second(3.0) == 8.0
    assert (_hits(first), _hits(second)) == (0, 1)
    assert len(machine_code(place)) == 1


def test_two_threads_that_ask_at_once_wait_for_the_same_machine_code(tmp_path, place, monkeypatch):
    # the proof's threads do; once the second one did not wait for the other process, and compiled for 5 s
    outer, asked, made = _started_anew(tmp_path).outer, Barrier(3), Event()
    monkeypatch.setitem(machine._beside, outer, lambda: made.wait(60.0))
    doors = []

    def ask():
        asked.wait()
        doors.append(compiled(outer))

    threads = [Thread(target=ask, daemon=True) for _ in range(2)]
    for thread in threads:
        thread.start()
    asked.wait()
    threads[0].join(0.2)  # both are inside, and wait
    assert not doors
    made.set()
    for thread in threads:
        thread.join()
    assert doors[0] is doors[1]


@pytest.mark.parametrize(("change", "value"), [({"factor": 3.0}, 12.0), ({"inner": "x - 1.0"}, 4.0)], ids=str)
def test_what_changed_in_a_constant_or_a_called_function_is_compiled_anew(change, value, tmp_path, place):
    assert compiled(_started_anew(tmp_path).outer)(3.0) == 8.0
    stamp = (tmp_path / "own.py").stat()
    changed = _started_anew(tmp_path, **change)
    os.utime(tmp_path / "own.py", ns=(stamp.st_atime_ns, stamp.st_mtime_ns))  # all that numba itself would look at
    assert compiled(changed.outer)(3.0) == value


def test_a_constant_from_elsewhere_counts_by_its_value(tmp_path, place):
    module = _started_anew(tmp_path)
    digest = machine._digest(module.outer)
    module.FACTOR = 5.0
    assert machine._digest(module.outer) != digest


def test_files_of_heatertune_that_are_mentioned_count(tmp_path, place):
    module = _started_anew(tmp_path)
    assert {path.name for path in machine._mentioned(tmp_path / "own.py")} == {"units.py"}
    exec(compile("def typed(x): return x", "<notebook>", "exec"), vars(module))
    assert machine._digest(module.typed) is None, "no file to look at: not kept"
    assert compiled(module.typed)(3.0) == 3.0
    assert machine_code(place) == []


def test_a_function_may_make_arrays_where_that_is_said(tmp_path, place):
    many = compiled(_started_anew(tmp_path).many, allocates=True)
    assert np.array_equal(many(3), [2.0, 4.0, 6.0])


def test_folders_that_nobody_used_for_a_month_are_removed(tmp_path):
    for name, days in (("compiled-old", 31), ("compiled-new", 29), ("else-old", 31)):
        (tmp_path / name / "wing_1").mkdir(parents=True)
        (tmp_path / name / "wing_1" / "a.nbi").write_text("")
        then = time.time() - days * 86_400.0
        os.utime(tmp_path / name, (then, then))
    machine._remove_stale(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {"compiled-new", "else-old"}


def test_where_no_folder_can_be_made_it_is_compiled_all_the_same(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(machine, "folder", lambda: tmp_path / "file" / "cache")
    assert compiled(_started_anew(tmp_path).outer)(3.0) == 8.0
    assert not list(tmp_path.rglob("*.nbi"))


@pytest.mark.parametrize("share", [0.0, 0.5])
@pytest.mark.parametrize("ending", ["nbi", "nbc"])
def test_what_was_torn_on_disk_is_compiled_anew_and_kept(ending, share, tmp_path, place):
    compiled(_started_anew(tmp_path).outer)(3.0)
    for path in place.rglob(f"*.{ending}"):
        path.write_bytes(path.read_bytes()[:int(share * path.stat().st_size)])
    for again in range(2):
        door = compiled(_started_anew(tmp_path).outer)
        assert door(3.0) == 8.0
        assert _hits(door) == again


def test_a_folder_that_is_gone_by_now_keeps_nothing(tmp_path, place):
    door = compiled(_started_anew(tmp_path).outer)
    shutil.rmtree(place)
    assert door(3.0) == 8.0


def test_what_is_kept_on_disk_is_loaded_for_less_work(tmp_path, place, monkeypatch):
    monkeypatch.setattr(machine, "_scans_asked", Counter())
    monkeypatch.setattr(machine, "_PLAIN_SCANS", 50_000)
    monkeypatch.setattr(machine, "_PLAIN_SCANS_KEPT", 15_000)
    monkeypatch.setattr(machine, "_PLAIN_SCANS_READY", 3_000)
    module = _started_anew(tmp_path)
    assert not machine.worth_compiling(15_001, "new", function=module.outer)
    compiled(module.outer)(3.0)
    assert [machine.worth_compiling(scans, "ready", function=module.outer) for scans in (3_000, 1)] == [False, True]
    monkeypatch.delitem(sys.modules, "numba")  # as in a process that has not loaded the compiler
    assert [machine.worth_compiling(scans, "kept", function=module.outer) for scans in (15_000, 1)] == [False, True]
    assert not machine.worth_compiling(15_001, "other", function=module.inner), "only what was compiled by itself"
    looks = []
    monkeypatch.setattr(machine, "is_kept", looks.append)
    assert not any(machine.worth_compiling(4_000, "cold", function=module.outer) for _ in range(9))
    assert len(looks) == 1, "looked for once, not in every run"


def test_what_is_only_called_is_taken_in_and_has_no_machine_code_of_its_own(tmp_path, place):
    module = _started_anew(tmp_path)
    assert compiled(module.outer)(3.0) == 8.0
    for function, runs in ((module.inner, False), (module.outer, True)):
        door = compiled(function) if runs else machine._machine(function, allocates=False, called=True)
        (made,) = door.overloads.values()
        assert made.library._codegen._engine.is_symbol_defined(made.fndesc.mangled_name) is runs


def test_what_is_called_and_makes_arrays_is_taken_in_too(tmp_path, place):
    first, second = (compiled(_started_anew(tmp_path).many, allocates=True) for _ in range(2))
    assert list(first(3)) == [2.0, 4.0, 6.0]
    assert list(second(3)) == [2.0, 4.0, 6.0]
    assert (_hits(first), _hits(second)) == (0, 1)
