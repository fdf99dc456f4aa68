"""The constraints that CI runs with are those of pyproject.toml."""

import re
import tomllib

import pytest
from tests.conftest import ROOT

PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
ASKED = [line for lines in (PROJECT["dependencies"], *PROJECT["optional-dependencies"].values()) for line in lines]
#: those that no test needs
UNTRIED = {"jupyterlab"}


def _name(text):
    return re.match(r"[\w.-]+", text)[0].lower().replace("_", "-")


def _pins(file):
    lines = (ROOT / "constraints" / file).read_text(encoding="utf-8").splitlines()
    return {_name(line): line.split("==")[1].split()[0] for line in lines if not line.startswith("#")}


def _numbers(version):
    return [int(part) for part in version.split(".")]


@pytest.fixture
def lowest_asked():
    return {_name(line): re.search(r">=([\d.]+)", line)[1] for line in ASKED if _name(line) not in UNTRIED}


def test_the_lowest_releases_are_the_lower_bounds(lowest_asked):
    pins = {name: _numbers(version) for name, version in _pins("lowest.txt").items()}
    for name, version in lowest_asked.items():
        bound = _numbers(version)
        assert pins[name][: len(bound)] == bound, name
        assert not any(pins[name][len(bound) :]), f"{name}: the first release of {version}"


def test_the_lock_holds_every_package_that_is_asked_for(lowest_asked):
    pins = _pins("lock.txt")
    assert set(lowest_asked) <= set(pins)
    assert all(_numbers(pins[name]) >= _numbers(version) for name, version in lowest_asked.items())


@pytest.mark.parametrize("name", ["numba", "llvmlite"])
def test_what_is_compiled_by_the_inside_of_numba_is_bounded_by_the_newest_releases_that_were_tried(name):
    (asked,) = {line for line in ASKED if _name(line) == name}
    before, tried = _numbers(re.search(r"<([\d.]+)", asked)[1]), _numbers(_pins("lock.txt")[name])
    assert before == [tried[0], tried[1] + 1]
