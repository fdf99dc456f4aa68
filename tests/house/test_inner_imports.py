"""Imports stand at the top of a file; those inside functions have one of the reasons here."""

import ast
import json
import os
import subprocess
import sys

import pytest
from tests.house.measure import ROOT, inside_functions, modules

#: libraries → why they are imported where they are used
LIBRARIES = {
    **dict.fromkeys(("casadi", "control", "llvmlite", "matplotlib", "numba", "pandas", "scipy"),
                    "it takes 0.03 to 1 s to load, and few commands need it"),
    **dict.fromkeys(("distributed", "pyarrow", "shtab"), "an extra that only one command needs"),
    "python_calamine": "an extra that only workbooks need",
    **dict.fromkeys(("ctypes", "difflib", "importlib.metadata", "tomllib", "traceback"), "some ms of each start, for what is rare"),
    "tty": "there are no pseudo-terminals on Windows",
}
COMMANDS = "what only the run of a command needs: its help must not wait for it"
#: importing module, imported module → why it is imported where it is used
OTHERS = {
    **dict.fromkeys((("chain.pipeline", "report"), ("chain.precompile", "report"), ("chain.worker", "report.plots"), ("chain.precompile", "chain.second_opinion"),
                     ("studio.background_work", "report")), "it loads matplotlib, or an optimiser, which only a report needs"),
    ("chain.precompile", "chain.worker"): "the worker's process imports all that a proof needs, the first process does not",
    **dict.fromkeys((("chain.stages", "model.fit"), ("chain.stages", "plc.s7_200_paper.step"),
                     ("plc.design", "pid.tune"), ("model.model_document", "model.reduction")),
                    "it loads an optimiser or compiles, and what is read or proven needs neither"),
    **dict.fromkeys((("doctor", "log"), ("doctor", "log.log_values"), ("doctor", "compiled")), "it may be what is broken"),
    ("compiled.dispatch", "compiled.numba_compiler"): "it loads Numba, which machine code on disk does not need",
    ("live.serve", "live.as511_server"): "only the protocol that is served is loaded",
    ("live.recorder", "live.mqtt_source"): "it loads the library of an extra, which only a broker needs",
    ("live.controller_block", "proof.words_file"): "a file that says where the signals are needs no proof's code",
    **dict.fromkeys((("pid.search.robust", "pid.continuous_optimum"), ("model.model_values", "model.transfer_functions")),
                    "the import at the top would close a circle"),
    **dict.fromkeys((("proof.difference", "proof.repetition"), ("proof.repetition", "proof.refine"), ("proof.repetition", "proof.monte_carlo.run"),
                     ("proof.runs", "proof.lanes.choice")), "few commands need the many loops behind it"),
}
SOURCE = modules(ROOT / "src" / "heatertune")
NAMES = {module.name for module in SOURCE}
INNER = [(module, node) for module in SOURCE for node in inside_functions(module)]


def imported(node):
    """Return the modules that an import statement loads."""
    if isinstance(node, ast.Import):
        return [alias.name for alias in node.names]
    return sorted({name if (name := f"{node.module}.{alias.name}") in NAMES else node.module for alias in node.names})


def is_command(module):
    return module.path.parent.name in ("cli", "commands") or module.path.name == "command.py"


def reason(module, target):
    """Return why a module imports another one inside of a function, None where nothing is known."""
    if target.startswith("heatertune"):
        return OTHERS.get((module.name.removeprefix("heatertune."), target.removeprefix("heatertune."))) or (
            COMMANDS if is_command(module) else None)
    return LIBRARIES.get(target) or LIBRARIES.get(target.split(".")[0])


def test_every_import_inside_a_function_has_its_reason():
    without = [f"{module.name}, line {node.lineno}: {target}" for module, node in INNER for target in imported(node)
               if reason(module, target) is None]
    assert not without, "import it at the top, or say here what that would cost"


def test_every_reason_is_in_use():
    pairs = {(module.name.removeprefix("heatertune."), target.removeprefix("heatertune."))
             for module, node in INNER for target in imported(node)}
    assert set(OTHERS) <= pairs
    targets = {target for _, target in pairs}
    assert all(any(target == name or target.startswith(f"{name}.") for target in targets) for name in LIBRARIES)


#: loads each module in a fork of its own, and prints what of its targets is loaded then; NumPy, which nearly all load, is loaded
#: once, after those modules one of whose targets it loads
FORKS = """
import importlib, json, os, sys
targets, by_numpy = json.loads(sys.stdin.read())
first = [module for module, names in targets.items() if set(names) & set(by_numpy)]
for module in [*first, *(module for module in targets if module not in first)]:
    if module not in first:
        import numpy
        assert not set(targets[module]) & sys.modules.keys(), "loaded by NumPy"
    child = os.fork()
    if not child:
        importlib.import_module(module)
        print(json.dumps([module, [name for name in targets[module] if name in sys.modules]]), flush=True)
        os._exit(0)
    assert os.waitpid(child, 0)[1] == 0, module
"""


@pytest.mark.long
@pytest.mark.skipif(not hasattr(os, "fork"), reason="there is no fork on Windows")
def test_an_import_inside_a_function_loads_what_its_module_does_not():
    targets = {}
    for module, node in INNER:
        targets.setdefault(module.name, set()).update(imported(node))
    ended = subprocess.run([sys.executable, "-c", FORKS], input=json.dumps([{module: sorted(names) for module, names in targets.items()}, ["ctypes"]]),
                           capture_output=True, text=True, check=True)
    loaded = dict(map(json.loads, ended.stdout.splitlines()))
    assert set(loaded) == set(targets)
    packages = {"heatertune.report", "heatertune.compiled", "heatertune.batch", "heatertune.cli"}  # their parts are loaded when they are used
    needless = {module: sorted(set(names) - packages) for module, names in loaded.items() if set(names) - packages}
    assert not needless, "these cost nothing at the top"
