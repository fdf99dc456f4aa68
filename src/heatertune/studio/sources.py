"""Where a log comes from: a path, a built-in table, or a folder that `heatertune design` wrote."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

from heatertune import chain
from heatertune.chain.documents import read_documents
from heatertune.log.tables import BUILT_IN
from heatertune.log.values import Log
from heatertune.model.document import from_document
from heatertune.model.values import FittedModel
from heatertune.progress import Told
from heatertune.settings import FitSettings
from heatertune.studio.settings import Settings

__all__ = ["Source", "fit_log", "read_source"]


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class Source:
    """What a path holds: a log, settings to begin with, and the heater where it is known already."""

    log: Log
    settings: Settings
    fitted: FittedModel | None = None


def read_source(source: str) -> Source:
    """Return what a log file, a built-in table or a folder holds.

    Raises:
        InputError: a file that is no log, a folder without the documents of `heatertune design`.
    """
    if not Path(source).is_dir():
        built_in = source.lower() in BUILT_IN
        return Source(log=chain.read_log(source, errata=built_in), settings=Settings())
    documents = read_documents(Path(source))
    held = documents["log"]
    columns = {name: held[name] for name in ("name", "source", "time_s", "temperature_degC", "power_pct",
                                              "setpoint_degC")}
    log = Log(**columns, repairs=tuple(held["repairs"]), doubts=tuple(held["doubts"]))
    settings = Settings(target=documents["words"]["target"], structure=documents["pid"]["structure"])
    return Source(log=log, settings=settings, fitted=from_document(documents["model"]))


def fit_log(log: Log, progress: Told = str, known: FitSettings | None = None) -> FittedModel:
    """Return the heater behind a log, as `heatertune design` finds it; arguments and errors as there."""
    return chain.fit(log, known, companions=True, progress=progress)
