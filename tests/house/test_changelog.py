"""The changelog is cut into short releases, and its newest one is the version of the package."""

import re
import tomllib
from itertools import pairwise

from tests.conftest import ROOT

import heatertune

LINES = (ROOT / "CHANGELOG.md").read_text(encoding="utf-8").splitlines()
HEADING = re.compile(r"## (\d+)\.(\d+)\.(\d+) – (\d{4}-\d{2}-\d{2})")
STARTS = [number for number, line in enumerate(LINES) if line.startswith("## ")]
RELEASES = [LINES[start:end] for start, end in pairwise([*STARTS, len(LINES)])]
MOST_LINES = 25


def test_each_release_has_a_version_a_date_and_at_most_25_lines():
    assert RELEASES
    for heading, *lines in RELEASES:
        assert HEADING.fullmatch(heading), heading
        assert len(lines) + 1 <= MOST_LINES, f"{heading}: merge what belongs together"
        assert max(map(len, lines)) <= 140, heading


def test_releases_stand_newest_first():
    found = [HEADING.fullmatch(heading).groups() for heading, *_ in RELEASES]
    versions = [tuple(map(int, numbers[:3])) for numbers in found]
    assert versions == sorted(set(versions), reverse=True)
    dates = [date for *_, date in found]
    assert dates == sorted(dates, reverse=True)


def test_the_newest_release_is_the_version_of_the_package():
    newest = HEADING.fullmatch(RELEASES[0][0])
    project = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
    assert heatertune.__version__ == project["version"] == ".".join(newest.groups()[:3])
