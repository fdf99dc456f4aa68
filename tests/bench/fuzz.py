"""Damaged logs, documents and options, thrown at every command: a refusal is one line and exit status 2, never a crash.

    python tests/bench/fuzz.py [--seed 1] [--count 20000 10000 6000] [--only documents:4711]

Every case is made from the seed, its kind and its number, so that `--only` brings one back. Commands run in this process.
Their results do not matter here: once a command computes (see `_DOORS`) it is given a moment and then left, as accepted.
"""

from __future__ import annotations

import argparse
import contextlib
import copy
import faulthandler
import io
import json
import os
import random
import resource
import shutil
import signal
import sys
import tempfile
import time
import traceback
import warnings
from collections import Counter
from collections.abc import Callable, Iterator, Sequence
from dataclasses import dataclass, field, replace
from functools import cache
from importlib import import_module
from pathlib import Path
from types import FrameType
from typing import Any, Final

sys.path.insert(0, str(Path(__file__).parents[2]))  # started as a file, the tests are no package yet

from heatertune.cli import main, parser
from heatertune.compiled import dispatch
from tests.bench import drawn_exports as messy
from tests.bench.documents import write_all

COUNTS: Final = {"logs": 20_000, "documents": 10_000, "options": 6_000}
HANG_S: Final = 10
# a busy machine may take long for little: what computes is timed by its processor time, what waits by the clock
_TIMERS: Final = ((signal.SIGPROF, signal.ITIMER_PROF, 1), (signal.SIGALRM, signal.ITIMER_REAL, 5))
LONGEST: Final = 500  # characters of a refusal
_MEMORY: Final = 6 << 30

#: where a command stops reading what it was given and begins to compute; the last ones serve or fork and are never run
_DOORS: Final = (
    "heatertune.chain.stages:fit", "heatertune.chain.stages:fit_known", "heatertune.chain.stages:fit_together",
    "heatertune.plc.design:tune", "heatertune.proof:prove", "heatertune.plc.word_selection:tune_for_words",
    "heatertune.plc.word_selection:choose_words", "heatertune.proof.setpoint_ramp:prove_ramped", "heatertune.proof.comparison:compare",
    "heatertune.proof.repetition:prove", "heatertune.chain.facade:plan", "heatertune.chain.pipeline:design",
    "heatertune.proof.advice:advise", "heatertune.proof.monte_carlo.run:sample_document",
    "heatertune.proof.monte_carlo.run:replay_document",
    "heatertune.pid.alternatives:front", "heatertune.proof.refine:refine", "heatertune.report:render",
)
_SHUT: Final = (
    "heatertune.batch.studies:run", "heatertune.batch.fleets:run", "heatertune.studio.server:serve",
    "heatertune.cli.reference:_run_bench", "heatertune.cli.reference:_run_doctor",
)

HEATER: Final = ("--gain", "0.37", "--time-constant", "167", "--dead-time", "12", "--ambient", "22")


class Accepted(BaseException):
    """The command took what it was given and computes."""


class Hung(BaseException):
    """The command neither refused nor began to compute in time."""


@dataclass
class Case:
    """One command line, run in a folder of its own.

    Attributes:
        arguments: as typed.
        out: what the command may write, beside nothing else.
        deep: whether it may begin to compute; else it is left at the door.
    """

    arguments: list[str]
    out: Path | None = None
    deep: bool = True


@dataclass
class Clock:
    """How long the case under way may compute, how long it may take until then [s], and whether it computes."""

    moment_s: float = 0.3
    hang_s: float = HANG_S
    deep: bool = True
    computing: bool = False

    def rings(self, _: int, frame: FrameType | None) -> None:
        # an import or a compiler left half-way stays so; what is raised in a weak reference's callback is lost
        if any(name in each.f_code.co_filename for each, _ in traceback.walk_stack(frame)
               for name in ("importlib", "numba", "weakref")):
            signal.setitimer(signal.ITIMER_PROF, 0.1)
            return
        raise Accepted if self.computing else Hung

    def entered(self) -> None:
        if not self.computing:
            self.computing = True
            if not self.deep:
                raise Accepted
            signal.setitimer(signal.ITIMER_PROF, self.moment_s)


@dataclass
class Tally:
    """What became of the cases of one kind.

    Attributes:
        cases: how many.
        ends: how they ended → how often.
        faults: fault and where → the numbers of its cases.
    """

    cases: int = 0
    ends: Counter[str] = field(default_factory=Counter)
    faults: dict[tuple[str, str], list[int]] = field(default_factory=dict)


# ---- what is run

@contextlib.contextmanager
def doors(clock: Clock) -> Iterator[None]:
    """Tell the clock where computing begins."""
    kept = []
    for name in (*_DOORS, *_SHUT):
        place, _, verb = name.partition(":")
        module = import_module(place)
        kept.append((module, verb, getattr(module, verb)))

    def door(verb: Callable[..., Any], shut: bool) -> Callable[..., Any]:
        def entered(*given: Any, **named: Any) -> Any:
            clock.entered()
            if shut:
                raise Accepted
            return verb(*given, **named)
        return entered

    kept.append((dispatch, "_PLAIN_SCANS", dispatch._PLAIN_SCANS))
    dispatch._PLAIN_SCANS = 10**12  # a compiler that is left half-way ends the process
    for module, verb, original in kept[:-1]:
        setattr(module, verb, door(original, f"{module.__name__}:{verb}" in _SHUT))
    try:
        yield
    finally:
        for module, verb, original in kept:
            setattr(module, verb, original)


def outcome(case: Case, clock: Clock) -> tuple[str, str]:
    """Run a case; return how it ended ("accepted", "refused" or a fault) and, of a fault, where."""
    said, told = io.StringIO(), io.StringIO()
    clock.computing, clock.deep = False, case.deep
    for each, timer, limit_s in _TIMERS:
        signal.signal(each, clock.rings)
        signal.setitimer(timer, limit_s * clock.hang_s)
    faulthandler.dump_traceback_later(6 * clock.hang_s, exit=True)
    try:
        with contextlib.redirect_stdout(said), contextlib.redirect_stderr(told), warnings.catch_warnings():
            warnings.simplefilter("always")
            status = main(case.arguments)
    except Accepted:
        return "accepted", ""
    except Hung as problem:
        return "hang", _place(problem)
    except SystemExit as problem:
        return ("accepted", "") if problem.code in (0, None) else ("exit", f"{problem.code}")
    except Exception as problem:
        return "traceback", f"{type(problem).__name__} {_place(problem)}"
    finally:
        for _, timer, _ in _TIMERS:
            signal.setitimer(timer, 0.0)
        faulthandler.cancel_dump_traceback_later()
    return _judged(status, told.getvalue(), case)


def _judged(status: int, told: str, case: Case) -> tuple[str, str]:
    """Return how a command ended that came back."""
    errors = [line for line in told.splitlines() if line.startswith("error: ")]
    if status == 70:
        return "traceback", told.strip()[:200]
    if status in (0, 1):
        if "Warning: " in told:
            return "warning on stderr", next(line for line in told.splitlines() if "Warning: " in line)[-120:]
        return ("refused" if errors else "accepted"), ""
    faults = {
        "exit status": status != 2,
        "refusal of several lines": not errors or told.count("\n") != 1 or len(told.splitlines()) != 1,
        "refusal too long": len(told) > LONGEST,
        "half-written": case.out is not None and case.out.exists() and any(case.out.parent.rglob("*.part")),
    }
    return next(((fault, _shape(told)) for fault, is_so in faults.items() if is_so), ("refused", ""))


def _place(problem: BaseException) -> str:
    frames = [each for each in traceback.extract_tb(problem.__traceback__) if "heatertune/" in each.filename
              and "tests/" not in each.filename]
    return f"{frames[-1].filename.split('heatertune/')[-1]}:{frames[-1].lineno}" if frames else "?"


def _shape(told: str) -> str:
    return "".join("0" if letter.isdigit() else letter for letter in told[:70].replace("\n", "|"))


# ---- what the commands are given

class Attack:
    """Makes cases in a folder from what lies in `base`."""

    def __init__(self, base: Path, folder: Path, seed: int) -> None:
        self.base, self.folder, self.seed = base, folder, seed
        self._texts: dict[str, str] = {}

    def case(self, kind: str, number: int) -> Case:
        """Return a case; the folder holds its files alone."""
        for path in self.folder.iterdir():
            shutil.rmtree(path) if path.is_dir() and not path.is_symlink() else path.unlink()
        chance = random.Random(f"{self.seed} {kind} {number}")
        return {"logs": self.log, "documents": self.document, "options": self.options}[kind](chance)

    # -- logs

    def log(self, chance: random.Random) -> Case:
        """Return `read` or `fit` on a file that is odd as a file, or a good one that was damaged."""
        if chance.random() < 0.1:
            path = chance.choice(_ODD_FILES)(self.folder, chance)
        else:
            written = chance.choice(messy.WRITERS)(chance)
            data = written.text.encode(written.encoding, errors="replace")
            for _ in range(chance.randint(1, 3)):
                data = chance.choice(_DAMAGES)(data, chance)
            path = self.folder / chance.choice(["log.csv", "log.csv", "log.txt", "log.tsv", "log.xlsx", "löß.csv", "-.csv"])
            path.write_bytes(data)
        command = chance.choice(["read", "read", "read", "fit"])
        more = [] if chance.random() < 0.6 else _reading(chance)
        return Case([command, "--quiet", *more, "--", str(path)], deep=chance.random() < 0.02)

    # -- documents

    def document(self, chance: random.Random) -> Case:
        """Return a command on documents of which one was damaged."""
        name, command = chance.choice(_READERS)
        here = self.folder / "out"
        here.mkdir()
        wanted = _SET if command[0] == "report" else ("model.json", "pid.json", "words.json", "proof.json", "bare.json")
        for beside in (*wanted, "study.toml", "log.csv", "inputs.csv"):
            os.link(self.base / beside, here / beside)
        (here / name).unlink()
        (here / name).write_bytes(self._damaged(name, chance))
        result = self.folder / "result"
        return Case([each.format(here=here, out=result) for each in command], result, deep=chance.random() < 0.5)

    def _damaged(self, name: str, chance: random.Random) -> bytes:
        original = (self.base / name).read_bytes()
        if name.endswith(".csv"):
            return chance.choice(_DAMAGES)(original, chance)
        if name.endswith(".toml"):
            return damaged_study(original.decode(), chance).encode("utf-8", errors="surrogatepass")
        draw = chance.random()
        if draw < 0.08:
            return chance.choice(_DAMAGES)(original, chance)
        document = json.loads(original)
        for _ in range(1 if draw < 0.8 else 2):
            document = _struck(document, chance)
        text = json.dumps(document, ensure_ascii=chance.random() < 0.5)
        if draw > 0.97:
            text = text.replace("{", '{"schema": 1, ', 1)
        if _DEEP in text:
            deep = chance.choice(["[", '{"a":'])
            text = text.replace(f'"{_DEEP}"', deep * 1000 + "0" + {"[": "]", '{"a":': "}"}[deep] * 1000)
        return text.encode("utf-8", errors="surrogatepass")

    # -- options

    def options(self, chance: random.Random) -> Case:
        """Return a good command with one to three options of any value."""
        command = chance.choice(_COMMANDS)
        result = self.folder / "result"
        arguments = [each.format(here=self.base, out=result) for each in command]
        for _ in range(chance.choice([1, 1, 2, 3])):
            arguments += self._option(command[0], chance)
        return Case(arguments, result)

    def _option(self, command: str, chance: random.Random) -> list[str]:
        action = chance.choice(options_of(command))
        flag = chance.choice(action.option_strings)
        if action.nargs == 0:
            return [flag] if chance.random() < 0.8 else [f"{flag}={chance.choice(_VALUES)}"]
        if action.dest == "out":
            return [flag, chance.choice(["", "\n", "--", "/dev/null/x", "/proc/x", ".", "é", "a" * 300])]
        if action.nargs in (2, "+"):
            return [flag, *(chance.choice(_VALUES) for _ in range(2 if action.nargs == 2 else chance.randint(0, 3)))]
        value = chance.choice([*action.choices]) if action.choices and chance.random() < 0.3 else chance.choice(_VALUES)
        return [f"{flag}={value}"] if chance.random() < 0.7 else [flag, value]


@cache
def options_of(command: str) -> list[argparse.Action]:
    """Return the options of a command."""
    groups = next(each for each in parser()._actions if isinstance(each, argparse._SubParsersAction))
    return [each for each in groups.choices[command]._actions if each.option_strings]


_VALUES: Final = (
    "--", "", " ", "\n", "a\nb", "1e308", "-1e308", "5e-324", "1e-300", "nan", "inf", "-inf", "-0", "-0.0", "0", "-1", "1", "2",
    "1e9", "999999999999999999999999", "9" * 400, "1_000", "٣", "½", "é", "\udcff", "\x00", "a=b", "=", "a=", "=b", "auto",
    "none", "words", "0x10", "1,5", "50", "17", "0.5", "x" * 1000, "-", "--out", "\u2028", "table4", "s7-300", "1e400",
)

_COMMANDS: Final = (
    ("read", "{here}/log.csv", "--quiet"),
    ("fit", "{here}/log.csv", "--quiet"),
    ("design", "{here}/log.csv", "--target", "s7-300", "--out", "{out}", "--quiet"),
    ("validate", "{here}/bare.json", "{here}/log.csv", "--quiet"),
    ("tune", "{here}/model.json", "--method", "simc", "--quiet"),
    ("tune", *HEATER, "--method", "simc", "--quiet"),
    ("tune", *HEATER, "--quiet"),
    ("verify", "{here}/words.json", "--target", "s5-ob251", *HEATER, "--quiet"),
    ("verify", "{here}/pid.json", "--target", "s7-300", "--words", "rounded", "--quiet"),
    ("export-db", "{here}/words.json", "--target", "s5-ob251", "-o", "{out}", "--quiet"),
    ("export-db", "{here}/pid.json", "--target", "weg", "-o", "{out}", "--quiet"),
    ("compare", "{here}/pid.json", "-o", "{out}", "--quiet"),
    ("advise", "{here}/log.csv", "--pid", "{here}/pid.json", "--setpoint", "50", "--quiet"),
    ("decode", "{here}/DB30.bin", "--target", "s5-ob251", "--called-every", "17", "--quiet"),
    ("decode", "{here}/DB30.bin", "--target", "s5-ob251", "--called-every", "17", "--model", "{here}/bare.json", "--quiet"),
    ("decode", "{here}/DB30_listing.txt", "--target", "s5-ob251", "--called-every", "17", "--quiet"),
    ("diff", "{here}", "{here}/DB30_listing.txt", "--quiet"),
    ("replay", "{here}/inputs.csv", "--target", "s5-ob251", "--words", "{here}/words.json", "--quiet"),
    ("pareto", "{here}/bare.json", "--points", "2", "--quiet"),
    ("plan", "{here}/bare.json", "--limit-temperature", "70", "--noise", "0.1", "--quiet"),
    ("plan", "--gain", "0.3", "0.4", "--time-constant", "100", "200", "--dead-time", "5", "20", "--ambient", "22",
     "--limit-temperature", "70", "--noise", "0.1", "--quiet"),
    ("study", "{here}/study.toml", "-o", "{out}/t.parquet", "--quiet"),
    ("fleet", "{here}/log.csv", "--target", "s7-300", "-o", "{out}/t.parquet", "--quiet"),
    ("report", "{here}", "--quiet"), ("targets",), ("doctor",), ("bench",), ("completion", "bash"), ("studio", "--no-browser"),
)

_SET: Final = ("log.json", "model.json", "pid.json", "words.json", "proof.json", "pictures.json", "comparison.json")

#: the document that is damaged, and a command that reads it
_READERS: Final = (
    ("model.json", ("tune", "{here}/model.json", "--method", "simc", "-o", "{out}", "--quiet")),
    ("bare.json", ("tune", "{here}/bare.json", "--method", "simc", "-o", "{out}", "--quiet")),
    ("model.json", ("validate", "{here}/model.json", "{here}/log.csv", "-o", "{out}", "--quiet")),
    ("bare.json", ("pareto", "{here}/bare.json", "--points", "2", "--quiet")),
    ("model.json", ("plan", "{here}/model.json", "--limit-temperature", "90", "--quiet")),
    ("model.json", ("decode", "{here}/../../base/DB30.bin", "--target", "s5-ob251", "--called-every", "17", "--model",
                    "{here}/model.json", "--quiet")),
    ("pid.json", ("verify", "{here}/pid.json", "--target", "s7-300", "--words", "rounded", "--quiet")),
    ("pid.json", ("export-db", "{here}/pid.json", "--target", "s7-300", "--words", "rounded", "-o", "{out}", "--quiet")),
    ("pid.json", ("compare", "{here}/pid.json", "-o", "{out}", "--quiet")),
    ("pid.json", ("advise", "{here}/log.csv", "--pid", "{here}/pid.json", "--setpoint", "50", "--quiet")),
    ("words.json", ("diff", "{here}/words.json", "{here}/../../base/DB30.bin", "--quiet")),
    ("proof.json", ("diff", "{here}", "{here}/../../base/DB30.bin", "--quiet")),
    ("pid.json", ("diff", "{here}/pid.json", "{here}/../../base/words.json", "--quiet")),
    ("words.json", ("verify", "{here}/words.json", "--target", "s5-ob251", *HEATER, "--quiet")),
    ("words.json", ("export-db", "{here}/words.json", "--target", "s5-ob251", "-o", "{out}", "--quiet")),
    ("words.json", ("replay", "{here}/inputs.csv", "--target", "s5-ob251", "--words", "{here}/words.json", "--quiet")),
    ("words.json", ("fit", "{here}/log.csv", "--controller", "s5-ob251", "--words", "{here}/words.json", "--quiet")),
    ("proof.json", ("export-db", "{here}/words.json", "--target", "s5-ob251", "-o", "{out}", "--quiet")),
    ("proof.json", ("export-db", "{here}/words.json", "--target", "s5-ob251", "-o", "{out}", "--force", "--quiet")),
    *((name, ("report", "{here}", "--quiet")) for name in _SET),
    ("study.toml", ("study", "{here}/study.toml", "-o", "{out}/t.parquet", "--quiet")),
    ("model.json", ("study", "{here}/study.toml", "-o", "{out}/t.parquet", "--quiet")),
    ("inputs.csv", ("replay", "{here}/inputs.csv", "--target", "s5-ob251", "--words", "{here}/words.json", "--quiet")),
)


# ---- damage

_DEEP: Final = "\x01deep"
_STRANGE: Final = (
    None, True, False, 0, -1, 1, 1e308, -1e308, 5e-324, float("nan"), float("inf"), -0.0, 10**400, "", "x", "1", "\ud800",
    "\x00", "a\nb", "\u2028", [], {}, [[]], {"x": 1}, ["x"], [None], _DEEP, "é" * 2000, [1.0, 2.0], [2.0, 1.0, 3.0],
)


def _places(value: Any, at: tuple[Any, ...] = ()) -> Iterator[tuple[Any, ...]]:
    """Return the path of every value in a document; of long lists the first and the last items."""
    if at:
        yield at
    keys: Sequence[Any] = ()
    if isinstance(value, dict):
        keys = list(value)
    elif isinstance(value, list):
        keys = range(len(value)) if len(value) < 4 else (0, 1, len(value) - 1)
    for key in keys:
        yield from _places(value[key], (*at, key))


def _struck(document: Any, chance: random.Random) -> Any:
    """Return a document with one place dropped, renamed, doubled or holding something strange."""
    if not isinstance(document, dict) or not document or chance.random() < 0.02:
        return chance.choice(_STRANGE)
    document = copy.deepcopy(document)
    at = chance.choice(list(_places(document)))
    holder = document
    for key in at[:-1]:
        holder = holder[key]
    draw = chance.random()
    if draw < 0.2:
        del holder[at[-1]]
    elif draw < 0.3 and isinstance(holder, dict):
        holder[chance.choice(["x", f"{at[-1]} ", "", "\ud800", "schema"])] = holder.pop(at[-1])
    elif draw < 0.4 and isinstance(holder, list):
        holder.insert(at[-1], chance.choice(holder))
    elif draw < 0.5 and isinstance(holder[at[-1]], int | float):
        holder[at[-1]] = chance.choice([-1.0, 1e6, 1e-6, 0.0]) * holder[at[-1]]
    else:
        holder[at[-1]] = chance.choice(_STRANGE)
    return document


def damaged_study(text: str, chance: random.Random) -> str:
    """Return the text of a study with a line dropped, doubled, or its value replaced."""
    lines = text.splitlines()
    for _ in range(chance.randint(1, 2)):
        k = chance.randrange(len(lines))
        draw = chance.random()
        if draw < 0.2:
            del lines[k]
        elif draw < 0.35:
            lines.insert(k, chance.choice(lines))
        elif "=" in lines[k]:
            key = lines[k].partition("=")[0] if chance.random() < 0.8 else chance.choice(["x ", '"" ', "samples ", "switches "])
            lines[k] = f"{key}= {chance.choice(_TOML)}"
        else:
            lines[k] = chance.choice(["[x]", "[[fixed]]", "[case]", "[grid.x]", "\x00", "[" * 500, "x = 1", ""])
    return "\n".join(lines) + "\n"


_TOML: Final = (
    "1", "-1", "0", "1e308", "5e-324", "nan", "inf", '""', '"x"', '"\\n"', "[]", "[[]]", "{}", "true", "1979-05-27", "99" * 200,
    "[1, 1]", '["s7-300", "x"]', "{ x = 1 }", '{ x = "y" }', "[{}]", "[nan]", "[" * 900 + "]" * 900, '"\\u0000"', '"\ud800"',
    "99999999999999999999",
)


def _flipped(data: bytes, chance: random.Random) -> bytes:
    made = bytearray(data)
    for _ in range(chance.choice([1, 3, 30])):
        if made:
            made[chance.randrange(len(made))] = chance.randrange(256)
    return bytes(made)


def _cut(data: bytes, chance: random.Random) -> bytes:
    a, b = sorted(chance.randint(0, len(data)) for _ in range(2))
    return chance.choice([data[:a], data[b:], data[:a] + data[b:]])


def _cell(data: bytes, chance: random.Random) -> bytes:
    """Put something strange in place of a cell."""
    lines = data.split(b"\n")
    k = chance.randrange(len(lines))
    mark = chance.choice([b",", b";", b"\t", b"|"])
    cells = lines[k].split(mark)
    cells[chance.randrange(len(cells))] = chance.choice(_CELLS)
    lines[k] = mark.join(cells)
    return b"\n".join(lines)


_CELLS: Final = (
    b"", b"NaN", b"inf", b"-inf", b"1e308", b"-1e308", b"1e400", b"5e-324", b"9" * 400, b"\xff", b"\xed\xa0\x80", b"\x00", b'"',
    b"'", b"1e", b"--", b"0x10", b"1.2.3", b"1,2,3", b"-", b"true", b"2026-02-30", b"2026-13-01 25:61:61", b"99999-01-01 00:00:00",
    b"1e18", b"-5", "½".encode(), "٣".encode(), b"x" * 5000, b"\x1b[31m", "\u2028".encode(), b"on", b"=1+1", b"1970-01-01T00:00:00Z",
    b"24:00:00", b"00:00:60", b"10000000000000000000000", b"1_0",
)


def _rows(data: bytes, chance: random.Random) -> bytes:
    lines = data.split(b"\n")
    draw = chance.random()
    if draw < 0.25:
        return b"\n".join(lines[:chance.randint(0, 4)])
    if draw < 0.5:
        chance.shuffle(lines)
    elif draw < 0.75:
        k = chance.randrange(len(lines))
        lines[k:k] = [lines[k]] * chance.choice([1, 50])
    else:
        del lines[chance.randrange(len(lines))]
    return b"\n".join(lines)


def _recoded(data: bytes, chance: random.Random) -> bytes:
    text = data.decode("utf-8", errors="replace")
    return text.encode(chance.choice(["utf-16", "utf-16-le", "utf-32", "utf-8-sig", "utf-7", "cp1252", "cp437"]), errors="replace")


def _inserted(data: bytes, chance: random.Random) -> bytes:
    k = chance.randint(0, len(data))
    return data[:k] + chance.choice([b"\x00", b"\xff\xfe", b'"', b"\r", b"\n\n", b";", b",", b"\xed\xa0\x80", b"#", b"\x1a"]) * chance.choice([1, 1, 7]) + data[k:]


_DAMAGES: Final = (_flipped, _cut, _cell, _cell, _rows, _recoded, _inserted)


def _named(name: str | bytes, data: bytes) -> Callable[[Path, random.Random], Path]:
    def make(folder: Path, _: random.Random) -> Path:
        path = folder / os.fsdecode(name)
        path.write_bytes(data)
        return path
    return make


def _fifo(folder: Path, _: random.Random) -> Path:
    os.mkfifo(folder / "log.csv")
    return folder / "log.csv"


def _big_cell(folder: Path, chance: random.Random) -> Path:
    path = folder / "log.csv"
    path.write_bytes(chance.choice([b"time [s],T [degC]\n0,20\n2,", b"", b"0,"]) + chance.choice([b"1", b"x", b'"', b",", b" "]) * (3 << 20)
                     + chance.choice([b"\n", b""]))
    return path


def _loop(folder: Path, _: random.Random) -> Path:
    (folder / "log.csv").symlink_to("log.csv")
    return folder / "log.csv"


_GOOD: Final = b"time [s],T [degC],power [%]\n" + b"".join(b"%d,%d,60\n" % (k, 20 + k) for k in range(40))
_ODD_FILES: Final = (
    _fifo, _big_cell, _loop,
    lambda *_: Path("/dev/zero"), lambda *_: Path("/dev/null"), lambda *_: Path("/dev/full"), lambda *_: Path("/proc/self/mem"),
    lambda folder, _: folder, lambda folder, _: folder / "missing.csv", lambda *_: Path(), lambda *_: Path("a" * 5000),
    lambda *_: Path("a\nb"), lambda *_: Path("\udcff.csv"), lambda *_: Path("x\x00y"), lambda *_: Path("table5"),
    _named(b"\xff\xfe.csv", _GOOD), _named(b"\xff.csv", b"x"), _named("a\nb.csv", b"x"), _named("\u2028.csv", b"x"), _named("e.csv", b""),
    _named("one.csv", b"time [s],T [degC]\n0,20\n"), _named("head.csv", b"time [s],T [degC]\n"), _named("nul.csv", b"\x00" * 5000),
    _named("ff.csv", b"\xff" * 5000), _named("nl.csv", b"\n" * 5000), _named("sur.csv", b"time,\xed\xa0\x80\n0,1\n1,2\n"),
    _named("huge.csv", b"time [s],T [degC]\n" + b"".join(b"%de300,%de300\n" % (k, k) for k in range(30))),
    _named("tiny.csv", b"time [s],T [degC]\n" + b"".join(b"%de-324,20\n" % (5 * k) for k in range(30))),
    _named("still.csv", b"time [s],T [degC],power [%]\n" + b"".join(b"%d,20,0\n" % k for k in range(30))),
    _named("bom16.csv", b"\xff\xfe"), _named("utf16.csv", _GOOD.decode().encode("utf-16")), _named("odd16.csv", _GOOD.decode().encode("utf-16")[:-1]),
    _named("zip.xlsx", b"PK\x03\x04" + bytes(500)), _named("wide.csv", b",".join([b"x"] * 20000) + b"\n" + b",".join([b"1"] * 20000)),
)


def _reading(chance: random.Random) -> list[str]:
    """Return one or two options of reading."""
    names = ("time-column", "temperature-column", "power-column", "setpoint-column", "date-column", "temperature-unit",
             "power-full-scale", "time-unit", "log-interval", "tag", "power-tag", "tag-column", "quality-column", "skip-rows", "run",
             "until")
    made = [f"--{chance.choice(names)}={chance.choice(('1', '2', '99', '0', '-1', 'none', 'T', 'degF', 's', '1e308', '5e-324', 'é', ''))}"
            for _ in range(chance.randint(1, 2))]
    return [*made, *(["--skip-empty"] if chance.random() < 0.5 else [])]


# ---- the whole

def attack(folder: Path, counts: dict[str, int], *, seed: int = 1, clock: Clock | None = None,
           deep: bool = True) -> dict[str, Tally]:
    """Run so many cases of each kind in a folder, none beyond its door unless `deep`; return what became of them."""
    base, here = folder / "base", folder / "here"
    if not base.exists():
        base.mkdir()
        write_all(base)
    here.mkdir(exist_ok=True)
    made, clock, tallies = Attack(base, here, seed), clock or Clock(), {kind: Tally() for kind in counts}
    cwd = Path.cwd()
    os.chdir(here)
    try:
        with doors(clock):
            for kind, count in counts.items():
                for number in range(count):
                    case = made.case(kind, number)
                    end, where = outcome(replace(case, deep=case.deep and deep), clock)
                    tallies[kind].cases += 1
                    tallies[kind].ends[end] += 1
                    if end not in ("accepted", "refused"):
                        tallies[kind].faults.setdefault((end, where), []).append(number)
    finally:
        os.chdir(cwd)
    return tallies


def lines_of(tallies: dict[str, Tally]) -> Iterator[str]:
    """Return the table, and what went wrong where."""
    ends = sorted({end for tally in tallies.values() for end in tally.ends} | {"accepted", "refused", "traceback", "hang"})
    yield "  ".join(["kind".ljust(10), "cases".rjust(6), *ends])
    for kind, tally in tallies.items():
        yield "  ".join([kind.ljust(10), str(tally.cases).rjust(6), *(str(tally.ends[end]).rjust(len(end)) for end in ends)])
    for kind, tally in tallies.items():
        for (end, where), numbers in sorted(tally.faults.items(), key=lambda item: -len(item[1])):
            yield f"{len(numbers):5} {end}: {where}   {kind}:{numbers[0]}"


def _main() -> int:
    options = argparse.ArgumentParser(description=__doc__)
    options.add_argument("--seed", type=int, default=1)
    options.add_argument("--count", type=int, nargs=3, default=list(COUNTS.values()), metavar=("LOGS", "DOCUMENTS", "OPTIONS"))
    options.add_argument("--only", metavar="KIND:NUMBER")
    options.add_argument("--hang", type=float, default=HANG_S, help="how long a refusal may compute [s]")
    options.add_argument("--moment", type=float, default=0.3, help="how long a command may compute [s]")
    given = options.parse_args()
    resource.setrlimit(resource.RLIMIT_AS, (_MEMORY, _MEMORY))
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        if given.only:
            return _one(folder, given)
        begun = time.monotonic()
        tallies = attack(folder, dict(zip(COUNTS, given.count, strict=True)), seed=given.seed, clock=Clock(given.moment, given.hang))
        print("\n".join(lines_of(tallies)), f"\n{time.monotonic() - begun:.0f} s", flush=True)
        return 1 if any(tally.faults for tally in tallies.values()) else 0


def _one(folder: Path, given: argparse.Namespace) -> int:
    (folder / "base").mkdir()
    (folder / "here").mkdir()
    write_all(folder / "base")
    kind, _, number = given.only.partition(":")
    case = Attack(folder / "base", folder / "here", given.seed).case(kind, int(number))
    os.chdir(folder / "here")
    print(repr(case.arguments)[:2000])
    return main(case.arguments)


if __name__ == "__main__":
    sys.exit(_main())
