"""Machine code on disk: found again, never taken for that of a changed program, removed when nobody uses it."""

import fcntl
import importlib.util
import os
import shutil
import sys
import time
from collections import Counter
from concurrent.futures import ThreadPoolExecutor
from threading import Barrier, Event, Thread

import numpy as np
import pytest

from heatertune import cache
from heatertune.compiled import compile_function, machine_code
from heatertune.compiled import dispatch as machine
from heatertune.compiled.loader import kinds_of
from heatertune.compiled.numba_compiler import object_code
from heatertune.heater.exact import unit_step_response

SOURCE = """
from heatertune.units import kelvin_to_degC

FACTOR = {factor}

def inner(x):
    return {inner}

def outer(x):
    return FACTOR * inner(x)

def many(out):
    for i in range(len(out)):
        out[i] = outer(float(i))
"""


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.setattr(machine, "folder", lambda: tmp_path / "cache")
    monkeypatch.setattr(sys, "dont_write_bytecode", True)  # Python's own cache tells no change within a second of equal length
    return tmp_path / "cache"


def _started_anew(tmp_path, factor=2.0, inner="x + 1.0"):
    """The functions as a new process would have them: another module object from the same file."""
    path = tmp_path / "own.py"
    text = SOURCE.format(factor=factor, inner=inner)
    if not path.exists() or path.read_text() != text:
        path.write_text(text)
    spec = importlib.util.spec_from_file_location("own", path)
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return module


def test_what_is_compiled_is_found_by_the_next_process(tmp_path, place):
    first, second = (compile_function(_started_anew(tmp_path).outer) for _ in range(2))
    assert first(3.0) == 8.0
    assert second(3.0) == 8.0
    assert [(door.found, door.made) for door in (first, second)] == [(0, 1), (1, 0)]
    assert len(machine_code(place)) == 1


def test_of_processes_that_need_the_same_at_once_one_compiles_and_the_others_wait(tmp_path, place):
    asked, doors = Barrier(3), [compile_function(_started_anew(tmp_path).outer) for _ in range(3)]

    def run(door):
        asked.wait()
        return door(3.0)

    with ThreadPoolExecutor(3) as pool:
        assert list(pool.map(run, doors)) == [8.0] * 3
    assert sorted((door.found, door.made) for door in doors) == [(0, 1), (1, 0), (1, 0)]
    assert not list(place.rglob("*.lock"))


def test_nobody_waits_for_ever_for_a_process_that_was_stopped(tmp_path, place, monkeypatch):
    door = compile_function(_started_anew(tmp_path).outer)
    path = door._place / door._name(kinds_of((3.0,)))
    with path.with_suffix(".lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        monkeypatch.setattr(machine, "_MOST_WAIT_S", 0.05)
        assert door(3.0) == 8.0
    assert (door.found, door.made) == (0, 1)


def test_two_threads_that_ask_at_once_wait_for_the_same_machine_code(tmp_path, place, monkeypatch):
    # the proof's threads do; once the second one did not wait for the other process, and compiled for 5 s
    outer, asked, made = _started_anew(tmp_path).outer, Barrier(3), Event()
    monkeypatch.setitem(machine._beside, outer, lambda: made.wait(60.0))
    doors = []

    def ask():
        asked.wait()
        doors.append(compile_function(outer))

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
    assert compile_function(_started_anew(tmp_path).outer)(3.0) == 8.0
    stamp = (tmp_path / "own.py").stat()
    changed = _started_anew(tmp_path, **change)
    os.utime(tmp_path / "own.py", ns=(stamp.st_atime_ns, stamp.st_mtime_ns))  # all that numba itself would look at
    assert compile_function(changed.outer)(3.0) == value


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
    assert compile_function(module.typed)(3.0) == 3.0
    assert machine_code(place) == []


def test_functions_whose_source_was_replaced_are_not_kept_for_the_new_one(monkeypatch):
    """What runs is the old source, and the files are the new one."""
    assert machine._digest(unit_step_response) is not None
    monkeypatch.setattr(cache, "_IMPORTED_S", 0.0)
    assert machine._digest(unit_step_response) is None


def test_calls_may_stay_calls(tmp_path, place):
    for calls in (False, True):
        door, out = compile_function(_started_anew(tmp_path).many, calls=calls), np.zeros(3)
        door(out)
        assert np.array_equal(out, [2.0, 4.0, 6.0])


def test_folders_that_nobody_used_for_a_month_are_removed(tmp_path):
    for name, days in (("compiled-old", 31), ("compiled-new", 29), ("else-old", 31)):
        (tmp_path / name / "wing_1").mkdir(parents=True)
        (tmp_path / name / "wing_1" / "a.code").write_text("")
        then = time.time() - days * 86_400.0
        os.utime(tmp_path / name, (then, then))
    machine._remove_stale(tmp_path)
    assert {path.name for path in tmp_path.iterdir()} == {"compiled-new", "else-old"}


def test_where_no_folder_can_be_made_it_is_compiled_all_the_same(tmp_path, monkeypatch):
    (tmp_path / "file").write_text("")
    monkeypatch.setattr(machine, "folder", lambda: tmp_path / "file" / "cache")
    assert compile_function(_started_anew(tmp_path).outer)(3.0) == 8.0
    assert not machine_code(tmp_path)


def _damaged(content, how):
    at = content.index(b"\x7fELF") if b"\x7fELF" in content else len(content) // 2  # where the object file begins
    return {"empty": b"", "torn": content[: len(content) // 2], "no object": content[:at], "other": b"{}\n" * 9,
            "one bit": content[:-9] + bytes([content[-9] ^ 1]) + content[-8:],
            "head": content.replace(b"outer", b"inner", 1)}[how]


@pytest.mark.parametrize("how", ["empty", "torn", "no object", "other", "one bit", "head"])
def test_what_was_damaged_on_disk_is_compiled_anew_and_kept(how, tmp_path, place):
    compile_function(_started_anew(tmp_path).outer)(3.0)
    path, = machine_code(place)
    whole = path.read_bytes()
    path.write_bytes(_damaged(whole, how))
    assert path.read_bytes() != whole
    for again in range(2):
        door = compile_function(_started_anew(tmp_path).outer)
        assert door(3.0) == 8.0
        assert (door.found, door.made) == (again, 1 - again)


def test_a_folder_that_is_gone_by_now_keeps_nothing(tmp_path, place):
    door = compile_function(_started_anew(tmp_path).outer)
    shutil.rmtree(place)
    assert door(3.0) == 8.0


def test_what_is_kept_on_disk_is_loaded_for_less_work(tmp_path, place, monkeypatch):
    monkeypatch.setattr(machine, "_scans_asked", Counter())
    monkeypatch.setattr(machine, "_PLAIN_SCANS", 50_000)
    monkeypatch.setattr(machine, "_PLAIN_SCANS_KEPT", 15_000)
    monkeypatch.setattr(machine, "_PLAIN_SCANS_READY", 3_000)
    module = _started_anew(tmp_path)
    assert not machine.worth_compiling(15_001, "new", function=module.outer)
    compile_function(module.outer)(3.0)
    assert [machine.worth_compiling(scans, "ready", function=module.outer) for scans in (3_000, 1)] == [False, True]
    monkeypatch.delitem(sys.modules, "llvmlite.binding")  # as in a process that has not loaded any code
    assert [machine.worth_compiling(scans, "kept", function=module.outer) for scans in (15_000, 1)] == [False, True]
    assert not machine.worth_compiling(15_001, "other", function=module.inner), "only what was compiled by itself"
    looks = []
    monkeypatch.setattr(machine, "has_machine_code", looks.append)
    assert not any(machine.worth_compiling(4_000, "cold", function=module.outer) for _ in range(9))
    assert len(looks) == 1, "looked for once, not in every run"


def test_what_is_only_called_is_taken_in_and_has_no_machine_code_of_its_own(tmp_path, place):
    module = _started_anew(tmp_path)
    name = b"_ZN3own5inner"  # as LLVM has it
    assert name not in object_code(module.outer, [3.0]).content
    assert name in object_code(module.inner, [3.0]).content
