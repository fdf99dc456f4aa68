"""Print the table of `docs/reference/install_size.md` from the packages of this environment: `python -m tests.docs.sizes`.

The size of a package is that of its files; what several need counts once for each row.
"""

import tomllib
from importlib import metadata

from packaging.requirements import Requirement
from tests.conftest import ROOT

PAGE = ROOT / "docs" / "reference" / "install_size.md"
PROJECT = tomllib.loads((ROOT / "pyproject.toml").read_text(encoding="utf-8"))["project"]
#: packages of other people for tuning or for the same data, to compare with
OTHERS = ("control", "casadi", "numba", "scipy", "nicegui", "asyncua")
#: extras that users install; the others are for the tests and the manual
EXTRAS = tuple(name for name in PROJECT["optional-dependencies"] if name not in ("test", "docs", "bench"))


def packages(requirements):
    """Return the packages that requirements bring here, themselves included; None if one is not installed."""
    found, open_ = set(), [Requirement(each) for each in requirements]
    while open_:
        asked = open_.pop()
        key = (asked.name.lower().replace("_", "-"), *sorted(asked.extras))
        if key in found:
            continue
        try:
            needed = map(Requirement, metadata.requires(asked.name) or [])
        except metadata.PackageNotFoundError:
            return None
        found.add(key)
        open_ += [each for each in needed
                  if each.marker is None or any(each.marker.evaluate({"extra": extra}) for extra in asked.extras or {""})]
    return {name for name, *_ in found}


def megabytes(names):
    """Return the size of the files of packages [MB]."""
    files = (file.locate() for name in names for file in metadata.files(name) or () if file.suffix != ".pyc")
    return sum(path.stat().st_size for path in files if path.is_file()) / 1e6


def rows():
    """Return the rows of the table: what is installed, packages, megabytes."""
    core = packages(PROJECT["dependencies"])
    yield "heatertune", len(core) + 1, megabytes(core)
    for extra in EXTRAS:
        more = packages(PROJECT["optional-dependencies"][extra])
        if more is not None:
            yield f"heatertune[{extra}]: in addition", len(more - core), megabytes(more - core)
    for name in OTHERS:
        its = packages([name])
        if its is not None:
            yield f"{name} alone", len(its), megabytes(its)


if __name__ == "__main__":
    print("| installed | packages | MB |\n| --- | ---: | ---: |")
    for what, count, size in rows():
        print(f"| `{what.partition(':')[0].partition(' ')[0]}`{what[len(what.partition(':')[0].partition(' ')[0]):]} | {count} | {size:.0f} |")
