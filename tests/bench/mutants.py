"""Plants small faults in the code that computes and judges, one at a time, and runs the fast tests that enter the place.

    python tests/bench/mutants.py --minutes 20 [--seed 1] [--only plc/s5_ob251] [--again survivors.txt]

A fault is an operator turned (< to <=, + to -, * to /, and to or, not left out), a whole number one more or less, a
switch turned over, min for max, or a statement left out; nothing is planted in annotations, decorators and the texts of
errors. All this happens in a copy of the checkout. Of each fault is printed: killed or SURVIVED, place, what was changed.
Known to change nothing: mutants.txt beside this file, a line for each: file | line of the source | column in it: what was
changed # reason; these are counted for themselves, and one whose fault is no longer there is told. Ends with status 1 where
another survives; what had to be stopped for its time is told as endless, and counted as killed.
What it runs is drawn by the seed, of each folder in turn, so a longer run goes on where a shorter one ends.

    python tests/bench/mutants.py --planted [--only proof/verdict] [--again survivors.txt]

plants the faults of planted.toml instead and runs the tests named there; prints how many of each area die.
"""

import argparse
import ast
import compileall
import contextlib
import copy
import importlib
import io
import os
import random
import re
import shutil
import signal
import sys
import tempfile
import time
import tomllib
from collections import Counter, defaultdict
from pathlib import Path

ROOT = Path(__file__).parents[2]
EQUIVALENT = Path(__file__).with_suffix(".txt")
PLANTED = Path(__file__).with_name("planted.toml")
SOURCE = "src/heatertune"
MUTATED = ("plc/**/*.py", *(f"proof/{name}.py" for name in (
    "criteria", "kernel", "long_outage", "loop", "meter", "phase_statistics", "plant", "proof", "runs", "test_sequence", "verdict", "words_file")))
#: the search for words and what the fit supposes: tested beside pid, model and chain, by long tests
NOT_HERE = ("choose", "choice", "promise", "design", "laws", "commissioning")
TESTS = ("tests/plc", "tests/golden", "tests/proof", "tests/chain/test_words.py")
#: imported before the copies are made of this process, for each would load them anew
SLOW_TO_LOAD = ("pytest", "numpy", "scipy.signal", "scipy.optimize", "control", "numba", "hypothesis", "matplotlib", "awlsim", "pandas")
LONGEST_S = 15.0  # of the tests of one fault, on the processor; what takes much longer has no end

#: they take longer than all others of one fault together
SLOW = (
    "tests/golden/test_fb41.py::test_a_call_is_total_for_every_bit_pattern",
    "tests/golden/test_fb41.py::test_a_rest_that_single_precision_cuts_off_is_not_lost",
    "tests/golden/test_s7_200_pid.py::test_decode_reads_a_dumped_loop_table",
    "tests/plc/test_largest_gain.py::test_ob251_is_given_the_best_of_the_gains_that_its_word_holds",
    "tests/plc/test_on_off.py::test_the_loop_swings_as_a_relay_with_dead_time_does",
    "tests/plc/test_running.py::test_a_held_ramp_is_that_of_the_proof_compiled_and_plain[s5-ob251-ramp0]",
    "tests/plc/test_running.py::test_a_held_ramp_is_that_of_the_proof_compiled_and_plain[weg-ramp1]",
)

TURNED = {
    ast.Lt: ast.LtE, ast.LtE: ast.Lt, ast.Gt: ast.GtE, ast.GtE: ast.Gt, ast.Eq: ast.NotEq, ast.NotEq: ast.Eq,
    ast.Is: ast.IsNot, ast.IsNot: ast.Is, ast.In: ast.NotIn, ast.NotIn: ast.In, ast.Add: ast.Sub, ast.Sub: ast.Add,
    ast.Mult: ast.Div, ast.Div: ast.Mult, ast.FloorDiv: ast.Mult, ast.Mod: ast.Add, ast.Pow: ast.Mult, ast.And: ast.Or,
    ast.Or: ast.And, ast.BitAnd: ast.BitOr, ast.BitOr: ast.BitAnd, ast.LShift: ast.RShift, ast.RShift: ast.LShift,
}
NAMES = {"min": "max", "max": "min", "any": "all", "all": "any", "floor": "ceil", "ceil": "floor"}


def faults(tree):
    """Return (place in the walk, which, line and column, first line of the function around it or 0, what changes) of each fault."""
    around, parents = {}, {}
    for node in ast.walk(tree):
        for child in ast.iter_child_nodes(node):
            parents[child] = node
            inside = isinstance(node, ast.FunctionDef) and child not in (*node.decorator_list, node.args, node.returns)
            first = min([node.lineno, *(d.lineno for d in node.decorator_list)]) if inside else 0
            around[child] = first or around.get(node, 0)
    for place, node in enumerate(ast.walk(tree)):
        if not _is_text(node, parents):
            for which, text in enumerate(_ways(node)):
                yield place, which, f"{node.lineno}:{node.col_offset + 1}", around.get(node, 0), text


def _is_text(node, parents):
    """Return whether a node is of an annotation, a decorator, an import, a list of names or an error's text."""
    while node in parents:
        above = parents[node]
        if isinstance(above, ast.Raise | ast.Import | ast.ImportFrom) or node in (getattr(above, "annotation", 0), getattr(above, "returns", 0)):
            return True
        if isinstance(above, ast.Assign) and isinstance(above.targets[0], ast.Name) and above.targets[0].id == "__all__":
            return True
        if node in getattr(above, "decorator_list", ()):
            return True
        node = above
    return False


def _ways(node):  # noqa: PLR0911 - one for each kind
    """Return what can be turned in a node, in words."""
    match node:
        case ast.Compare():
            return [f"{ast.unparse(node)}: {_name(op)} turned" for op in node.ops[:1]]
        case ast.BinOp() | ast.BoolOp() | ast.AugAssign() if type(node.op) in TURNED:
            return [f"{ast.unparse(node)}: {_name(node.op)} turned"]
        case ast.UnaryOp(op=ast.Not() | ast.USub()):
            return [f"{ast.unparse(node)}: {_name(node.op)} left out"]
        case ast.Constant(value=bool()):
            return [f"{node.value} turned"]
        case ast.Constant(value=int() | float()):
            return [f"{node.value} + 1", f"{node.value} - 1"] if node.value + 1 != node.value else []
        case ast.Call(func=ast.Name(id=name)) if name in NAMES:
            return [f"{ast.unparse(node)}: {NAMES[name]}"]
        case ast.Call(func=ast.Attribute(attr=name)) if name in NAMES:
            return [f"{ast.unparse(node)}: {NAMES[name]}"]
        case ast.Raise() | ast.Expr(value=ast.Call()) | ast.AugAssign():
            return [f"left out: {ast.unparse(node)}"]
    return []


def _name(op):
    return type(op).__name__


def planted(tree, place, which):  # noqa: C901, PLR0912 - one branch for each kind
    """Return the source with one fault."""
    tree = copy.deepcopy(tree)
    node = next(node for k, node in enumerate(ast.walk(tree)) if k == place)
    match node:
        case ast.Compare():
            node.ops[0] = TURNED[type(node.ops[0])]()
        case ast.BinOp() | ast.BoolOp():
            node.op = TURNED[type(node.op)]()
        case ast.AugAssign() if type(node.op) in TURNED:
            node.op = TURNED[type(node.op)]()
        case ast.UnaryOp():
            node.op = ast.UAdd() if isinstance(node.op, ast.USub) else ast.Not()
            if isinstance(node.op, ast.Not):
                node.operand = ast.UnaryOp(op=ast.Not(), operand=node.operand)
        case ast.Constant(value=bool()):
            node.value = not node.value
        case ast.Constant():
            node.value += 1 - 2 * which
        case ast.Call(func=ast.Name()):
            node.func.id = NAMES[node.func.id]
        case ast.Call():
            node.func.attr = NAMES[node.func.attr]
        case _:
            for above in ast.walk(tree):
                for _, value in ast.iter_fields(above):
                    if isinstance(value, list) and node in value:
                        value[value.index(node)] = ast.copy_location(ast.Pass(), node)
    return ast.unparse(ast.fix_missing_locations(tree)) + "\n"


class Entered:
    """Plugin of pytest: which functions each test enters, and how long it takes."""

    def __init__(self, copied):
        self.prefix, self.tests, self.took, self.now, self.began = str(copied / SOURCE), defaultdict(set), {}, None, 0.0

    def _note(self, frame, event, _):
        code = frame.f_code
        if event == "call" and self.now and code.co_filename.startswith(self.prefix):
            self.tests[code.co_filename, code.co_firstlineno].add(self.now)

    def pytest_runtest_logstart(self, nodeid):
        """Begin a test."""
        self.now, self.began = nodeid, time.process_time()
        sys.setprofile(self._note)

    def pytest_runtest_logreport(self, report):
        """Note its time on the processor; one that fails kills nothing."""
        took = time.process_time() - self.began if report.passed else float("inf")
        self.took[report.nodeid] = max(self.took.get(report.nodeid, 0.0), took)


def in_a_child(work, limit_s):
    """Return the exit status of work done in a copy of this process; None: it was stopped, or died."""
    child = os.fork()
    if child == 0:
        signal.setitimer(signal.ITIMER_PROF, limit_s)  # of the processor: others may be at work
        signal.alarm(int(20.0 * limit_s))
        quiet = os.open(os.devnull, os.O_WRONLY)
        os.dup2(quiet, 1)
        os.dup2(quiet, 2)
        os._exit(work())
    status = os.waitpid(child, 0)[1]
    return os.WEXITSTATUS(status) if os.WIFEXITED(status) else None


def run(arguments, plugins=()):
    """Return pytest's exit status."""
    import pytest  # noqa: PLC0415 - of the child, in the copy

    plain = ["-n", "0", "-q", "-x", "-p", "no:randomly", "--hypothesis-seed=0", "-W", "ignore::pytest.PytestAssertRewriteWarning"]
    return int(pytest.main([*plain, *arguments], plugins=list(plugins)))


def load_once(tests):
    """Import what every copy of this process needs, and rewrite the tests' assertions on disk; keep nothing of heatertune."""
    for name in SLOW_TO_LOAD:
        importlib.import_module(name)
    with contextlib.redirect_stdout(io.StringIO()):
        run(["--collect-only", *tests])
    for name in [name for name in sys.modules if name.partition(".")[0] in ("heatertune", "tests")]:
        del sys.modules[name]


def map_tests(copied, kept):
    """Return (file, first line of function) → tests, and test → seconds, by one run of all fast tests."""
    place = kept or copied / "entered.txt"
    if kept and kept.exists():
        return 0, *_read(kept)

    def work():
        plugin = Entered(copied)
        slow = [f"--deselect={test}" for test in SLOW]
        status = run(["-m", "fast", "--maxfail=1000", *TESTS, *slow], [plugin])
        entered = {(name.removeprefix(plugin.prefix), line): those for (name, line), those in plugin.tests.items()}
        place.write_text(repr((entered, plugin.took)))
        return status

    status = in_a_child(work, 3600)
    return status, *_read(place)


def _read(place):
    return eval(place.read_text(), {"inf": float("inf")})  # what this file wrote


def chosen(tests, took, path, first, longest_s):
    """Return the tests that enter the function, the shortest first, and their time.

    Of what stands outside all functions: those that enter the file, or one that imports it, and those of a file that does.
    """
    files, beside = {path}, set()
    if not any(line == first and str(path).endswith(SOURCE + name) for name, line in tests):  # at import, or outside
        first = 0
        root = next(folder for folder in path.parents if str(folder).endswith(SOURCE))
        package, stem = ".".join(("heatertune", *path.relative_to(root).parts[:-1])), path.stem
        imports = re.compile(rf"from {package}\.{stem} import|from {package} import .*\b{stem}\b")
        files |= {other for other in root.rglob("*.py") if imports.search(other.read_text())}
        beside = {test for test in took if imports.search((root.parents[1] / test.partition("::")[0]).read_text())}
    entered = beside | {test for (name, line), those in tests.items() for test in those
                        if line in (first or line, first) and any(str(file).endswith(SOURCE + name) for file in files)}
    total, taken = 0.0, []
    for test in sorted(entered, key=lambda test: (test not in beside, took.get(test, 0.0), test)):
        if total + took.get(test, 0.0) < longest_s:
            total += took.get(test, 0.0)
            taken.append(test)
    return taken, total


def main():
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("--minutes", type=float, default=20.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--each", type=int, help="at most so many of each folder, and of each file of proof")
    parser.add_argument("--only", nargs="+", default=[""], help="parts of files' paths: those that have one of them")
    parser.add_argument("--longest", type=float, default=LONGEST_S, help="of the tests of one fault [s]; the shortest come first")
    parser.add_argument("--map", type=Path, help="where the map from functions to tests is kept for the next run")
    parser.add_argument("--tests", nargs="+", help="run these for each fault, not those that enter its place")
    parser.add_argument("--again", type=Path, help="a former run's output: its survivors only")
    parser.add_argument("--planted", action="store_true", help="those of planted.toml, nothing drawn")
    asked = parser.parse_args()
    asked.map, asked.again = (path and path.resolve() for path in (asked.map, asked.again))  # before the folder is another
    end = time.monotonic() + 60.0 * asked.minutes
    with tempfile.TemporaryDirectory() as folder:
        copied = Path(folder) / "heatertune"
        shutil.copytree(ROOT, copied, ignore=shutil.ignore_patterns(".git", "__pycache__", ".pytest_cache", ".hypothesis", "shared"))
        os.chdir(copied)
        os.environ |= {"PYTHONPATH": f"{copied / 'src'}", "HEATERTUNE_CACHE": f"{copied / 'cache'}"}
        sys.path[:0] = [str(copied / "src"), str(copied)]
        compileall.compile_dir(copied / "src", quiet=2)
        by_hand = chosen_by_hand(asked) if asked.planted else []
        load_once(asked.tests or sorted({test.partition("::")[0] for fault in by_hand for test in fault["tests"]}) or TESTS)
        raise SystemExit(planted_by_hand(copied, by_hand) if asked.planted else attacked(copied, asked, end))


def chosen_by_hand(asked):
    """Return the faults of the table that are asked for."""
    left, faults = survivors(asked.again), tomllib.loads(PLANTED.read_text())["fault"]
    return [fault for fault in faults if any(part in fault["file"] for part in asked.only)
            and (left is None or f"{fault['file']}: {fault['name']}" in left)]


def survivors(printed):
    """Return the faults that survived by what a former run printed; None: there was none."""
    return None if printed is None else {line.partition("SURVIVED ")[2] for line in printed.read_text().splitlines() if "SURVIVED " in line}


def planted_by_hand(copied, faults):
    """Plant each fault of the table, print what became of it; return how many survive, or are no longer there."""
    sys.dont_write_bytecode = True
    if faults and in_a_child(lambda: run(["-m", "fast", *sorted({test for fault in faults for test in fault["tests"]})]), 600.0) != 0:
        raise SystemExit("the tests fail where nothing is planted")
    of_each = defaultdict(Counter)
    for fault in faults:
        path = copied / SOURCE / fault["file"]
        plain = path.read_text() if path.exists() else ""
        found = plain.count(fault["old"]) == 1
        outcome = struck(path, plain.replace(fault["old"], fault["new"]), ["-m", "fast", *fault["tests"]], LONGEST_S) if found else "NOT THERE"
        of_each[fault["area"]][outcome] += 1
        print(f"{outcome} {fault['file']}: {fault['name']}", flush=True)
    for area, counts in of_each.items():
        print(f"{area}: {dict(counts)}")
    left = sum(counts["SURVIVED"] + counts["NOT THERE"] for counts in of_each.values())
    print(f"{len(faults)} faults planted by hand, {left} left")
    return left


def attacked(copied, asked, end):
    """Plant until the time is up, print each fault; return 1 where one survives that is not known to change nothing."""
    status, tests, took = (0, {}, {}) if asked.tests else map_tests(copied, asked.map)
    sys.dont_write_bytecode = True
    if not took and not asked.tests:
        raise SystemExit(f"no test ran, pytest ended with status {status}")
    print(f"{len(took)} tests in {sum(took.values()):.0f} s, status {status}", flush=True)
    trees = {path: ast.parse(path.read_text()) for pattern in MUTATED for path in sorted((copied / SOURCE).glob(pattern))
             if path.stem not in NOT_HERE or path.parent.name not in ("plc", "s7_200_paper")}
    every = [(path, *fault) for path, tree in trees.items()
             if any(part in str(path.relative_to(copied / SOURCE)) for part in asked.only) for fault in faults(tree)]
    again = survivors(asked.again)
    same = {line.rpartition(" # ")[0] for line in EQUIVALENT.read_text().splitlines()} if EQUIVALENT.exists() else set()
    sources = {path: path.read_text().splitlines() for path in trees}
    planted_here = {_known_as(path.relative_to(copied / SOURCE), sources[path], fault[2], fault[4]) for path, *fault in every}
    every = drawn(every, asked.seed, asked.each)
    for stale in sorted(line for line in same - planted_here if any(part in line.partition(" | ")[0] for part in asked.only)):
        print(f"no longer there: {stale}")
    counts, of_each = Counter(), defaultdict(Counter)
    for path, place, which, at, first, text in every:
        if time.monotonic() > end:
            break
        label = f"{path.relative_to(copied / SOURCE)}:{at}: {' '.join(text.split())}"
        if again is not None and label not in again:
            continue
        known = _known_as(path.relative_to(copied / SOURCE), sources[path], at, text)
        outcome = "equal" if known in same else struck(
            path, planted(trees[path], place, which), *((["-m", "fast", *asked.tests], LONGEST_S) if asked.tests else chosen(tests, took, path, first, asked.longest)))
        counts[outcome] += 1
        of_each[_group(path)][outcome] += 1
        print(f"{outcome} {label}", flush=True)
    for name, found in of_each.items():
        print(f"{name}: {dict(found)}")
    killed = counts["killed"] + counts["endless"]
    print(f"{len(every)} faults, {sum(counts.values())} run: {dict(counts)}; killed {100.0 * killed / max(killed + counts['SURVIVED'], 1):.1f} %")
    return int(counts["SURVIVED"] > 0)


def drawn(every, seed, each):
    """Return the faults in the order of the seed, one of each folder (of proof: each file) in turn; at most so many of each."""
    groups = defaultdict(list)
    for fault in every:
        groups[_group(fault[0])].append(fault)
    for name, those in groups.items():
        random.Random(f"{seed} {name}").shuffle(those)
    turns = range(min(each or len(every), max(map(len, groups.values()), default=0)))
    return [those[k] for k in turns for those in groups.values() if k < len(those)]


def _group(path):
    return path.stem if path.parent.name == "proof" else "/".join(path.parts[len(path.parts) - path.parts[::-1].index("plc") - 1:-1])


def _known_as(path, lines, at, text):
    """Return what a fault is called in mutants.txt, which outlives changes elsewhere in the file."""
    line, column = map(int, at.split(":"))
    plain = lines[line - 1]
    return f"{path} | {plain.strip()} | {column - len(plain) + len(plain.lstrip())}: {' '.join(text.split())}"


def struck(path, source, tests, total):
    """Return "killed", "endless" (stopped for its time) or "SURVIVED" of a file with a fault."""
    if not tests:
        return "SURVIVED"
    plain = path.read_text()
    for stale in (path.parent / "__pycache__").glob(f"{path.stem}.*.pyc"):
        stale.unlink()
    path.write_text(source)
    try:
        status = in_a_child(lambda: run(tests), 20.0 + 5.0 * total)
        return "SURVIVED" if status in (0, 5) else "endless" if status is None else "killed"  # 5: no test was chosen
    finally:
        path.write_text(plain)


if __name__ == "__main__":
    main()
