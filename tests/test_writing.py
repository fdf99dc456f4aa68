"""Sets of files, written while each operation in turn fails, or is where the process is killed."""

import json
import subprocess
import sys

import pytest

from heatertune.errors import InputError
from heatertune.writing import write_files

OLD = {"data/words.json": "old words", "data/proof.json": "old proof", "report.html": "old report"}
NEW = {"data/words.json": "new words", "data/proof.json": "new proof", "block.awl": b"new block"}

#: writes NEW into a folder that holds OLD and a note, once for each operation the interpreter reports (its audit
#: events), which is made to fail or ends the process by SIGKILL; prints what is there then, and what one more write leaves
ATTACK = """
import json, os, shutil, signal, sys
from pathlib import Path
from heatertune.errors import InputError
from heatertune.writing import write_files

given = json.loads(sys.argv[1])
folder = Path(given["folder"])
EVENTS = {"open", "os.mkdir", "os.link", "os.rename", "os.remove", "os.rmdir", "os.scandir", "os.listdir", "os.chmod",
          "shutil.copyfile", "ctypes.call_function"}
count = at = 0

def watch(event, _):
    global count
    if at and event in EVENTS:
        count += 1
        if count == at:
            if given["kill"]:
                os.kill(os.getpid(), signal.SIGKILL)
            raise OSError(28, "No space left on device")

sys.addaudithook(watch)

def held():
    return {str(path.relative_to(folder)): path.read_text() for path in folder.rglob("*")
            if path.is_file() and not path.name.startswith(".")}

def begin():
    shutil.rmtree(folder, ignore_errors=True)
    folder.mkdir(parents=True)
    (folder / "note.txt").write_text("mine")
    (folder / "words.json").write_text("of an earlier release")
    if given["nested"]:
        (folder / "below").mkdir()
    write_files(folder, given["old"])

states = []
for k in range(1, 300):
    begin()
    child = os.fork()
    if child == 0:
        at = k
        try:
            write_files(folder, given["new"], gone=["words.json"])
        except InputError:
            at = 0
            os._exit(2)
        os._exit(0 if count < k else 3)
    status = os.waitstatus_to_exitcode(os.waitpid(child, 0)[1])
    states.append((status, held()))
    if status == 0:
        break
write_files(folder, given["new"], gone=["words.json"])
print(json.dumps([states, sorted(str(path.relative_to(folder.parent)) for path in folder.parent.rglob("*"))]))
"""


def attacked(folder, *, kill, nested=False):
    new = {name: content if isinstance(content, str) else content.decode() for name, content in NEW.items()}
    given = {"folder": str(folder), "kill": kill, "nested": nested, "old": OLD, "new": new}
    ended = subprocess.run([sys.executable, "-c", ATTACK, json.dumps(given)], capture_output=True, text=True, check=True,
                           timeout=60.0)
    return json.loads(ended.stdout)


BEFORE = {"note.txt": "mine", "words.json": "of an earlier release", **OLD}
AFTER = {"note.txt": "mine", **OLD, **{name: str(content).removeprefix("b'").rstrip("'") for name, content in NEW.items()}}


def test_a_kill_at_any_operation_leaves_the_old_set_or_the_new(tmp_path):
    states, left = attacked(tmp_path / "here" / "out", kill=True)
    statuses = [status for status, _ in states]
    assert statuses[-1] == 0
    assert set(statuses[:-1]) == {-9}, "each was killed by the signal"
    assert len(states) > 10
    sets = [held for _, held in states]
    assert all(held in (BEFORE, AFTER) for held in sets)
    assert sets[0] == BEFORE
    assert sets[-1] == AFTER
    assert left == ["out", *sorted(f"out/{name}" for name in ("data", *AFTER))], "what the killed ones left beside is gone"


@pytest.mark.parametrize("nested", [False, True])
def test_an_operation_that_fails_leaves_the_old_set_and_is_told_or_the_new(tmp_path, nested):
    """With a folder in the folder the files are renamed one by one: then those renamed before go back."""
    states, left = attacked(tmp_path / "here" / "out", kill=False, nested=nested)
    assert states[-1][0] == 0
    for status, held in states:
        assert held == (BEFORE if status == 2 else AFTER)
    assert not nested or any(status == 2 for status, _ in states), "there is no other way left"
    below = ["out/below"] if nested else []
    assert left == ["out", *sorted([*below, "out/data", *(f"out/{name}" for name in AFTER)])]


def test_what_else_lies_in_the_folder_stays_as_it_is(tmp_path):
    """The folder may be a link, have a mode of its own, and hold links that lead nowhere."""
    real, out = tmp_path / "real", tmp_path / "out"
    real.mkdir(mode=0o750)
    out.symlink_to(real)
    (real / "gone").symlink_to("nowhere")
    (real / "note").write_text("mine")
    inode = (real / "note").stat().st_ino
    assert write_files(out, OLD) == [out / name for name in OLD]
    assert (real / "gone").is_symlink()
    assert (real / "note").stat().st_ino == inode
    assert real.stat().st_mode & 0o777 == 0o750
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out", "real"]


def test_a_folder_in_the_place_of_a_file_is_refused_and_nothing_is_written(tmp_path):
    (tmp_path / "block.awl").mkdir()
    with pytest.raises(InputError, match=r"block\.awl: cannot be written"):
        write_files(tmp_path, NEW)
    assert [path.name for path in tmp_path.iterdir()] == ["block.awl"]


def test_the_folder_one_works_in_stays_the_same_folder(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    inode = tmp_path.stat().st_ino
    write_files(".", NEW)
    assert tmp_path.stat().st_ino == inode
    assert sorted(str(path.relative_to(tmp_path)) for path in tmp_path.rglob("*")) == sorted(["data", *NEW])
