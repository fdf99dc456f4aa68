"""The paper's tables: numbers exactly as printed, and their known errata."""

from __future__ import annotations

import tomllib
from dataclasses import dataclass
from pathlib import Path
from typing import Final

from heatertune.errors import LogError

__all__ = ["BUILT_IN", "BuiltIn", "Erratum", "built_in"]

BUILT_IN: Final = ("table3", "table4")


@dataclass(frozen=True, slots=True, kw_only=True)
class Erratum:
    """A misprint of a table: line and column, printed and correct value, and the evidence."""

    line: int
    column: str
    printed: float
    corrected: float
    reason: str


@dataclass(frozen=True, slots=True, kw_only=True)
class BuiltIn:
    """One table.

    Attributes:
        name: "table3" or "table4".
        path: its CSV file.
        source: the paper, as one line.
        errata: its misprints.
        doubts: suspicious readings that are left as they are, one sentence each.
        same_heater: other tables of the same heater.
        rests_at_degC: where the record rests before it is disturbed [°C].
    """

    name: str
    path: Path
    source: str
    errata: tuple[Erratum, ...]
    doubts: tuple[str, ...]
    same_heater: tuple[str, ...]
    rests_at_degC: float


def built_in(name: str) -> BuiltIn:
    """Return a built-in table.

    Raises:
        LogError: the installation lacks the data.
    """
    folder = _folder()
    described = tomllib.loads((folder / f"{name}.toml").read_text(encoding="utf-8"))
    return BuiltIn(
        name=name,
        path=folder / f"{name}.csv",
        source=f"{described['source']['citation']}, {described['source']['table']}",
        errata=tuple(Erratum(**misprint) for misprint in described.get("errata", ())),
        doubts=tuple(f"t = {odd['time_s']} s, {odd['reading']} °C: {odd['why']}" for odd in described["suspicious"]),
        same_heater=tuple(described["same_heater"]),
        rests_at_degC=float(described["rests_at_degC"]),
    )


def _folder() -> Path:
    package = Path(__file__).parents[1]
    for folder in (package / "data" / "paper_tables", package.parents[1] / "data" / "paper_tables"):
        if (folder / "table3.csv").is_file():
            return folder
    raise LogError("the built-in tables are missing; install heatertune again", file=package / "data" / "paper_tables")
