"""Whatever a session has at hand → Log."""

from __future__ import annotations

from pathlib import Path
from typing import IO, TYPE_CHECKING, Any

import numpy as np
import numpy.typing as npt

from heatertune.errors import InputError
from heatertune.log.read import read_log
from heatertune.log.values import Log

if TYPE_CHECKING:
    from pandas import DataFrame

__all__ = ["log_of"]


def log_of(data: Log | str | Path | IO[Any] | DataFrame | tuple[npt.ArrayLike, ...]) -> Log:
    """Return the log in what is given.

    Args:
        data: a log; what `read_log` reads: path or built-in name, an open file, a table of pandas; or the columns
            (time_s, temperature_degC, power_pct), all of shape (n,), the power left out or None where there is none.

    Raises:
        InputError: none of these, columns that are no numbers.
        LogError: as `read_log`.
        OutOfRange: as `Log`.
    """
    if isinstance(data, Log):
        return data
    if isinstance(data, str | Path) or hasattr(data, "read") or hasattr(data, "to_csv"):
        return read_log(data)
    if not isinstance(data, tuple) or not 2 <= len(data) <= 3:
        raise InputError(f"not a log: {type(data).__name__}; expected a log, a path, an open file, a pandas table, or "
                         "arrays (time_s, temperature_degC, power_pct)")
    time, temperature, *rest = data
    power = _numbers("power_pct", rest[0]) if rest and rest[0] is not None else None
    return Log(name="arrays", source="arrays", time_s=_numbers("time_s", time),
               temperature_degC=_numbers("temperature_degC", temperature), power_pct=power)


def _numbers(name: str, column: npt.ArrayLike) -> npt.NDArray[np.float64]:
    try:
        numbers = np.asarray(column, dtype=np.float64)
    except (TypeError, ValueError) as problem:
        raise InputError(f"{name}: not an array of numbers") from problem
    if numbers.ndim != 1:
        raise InputError(f"{name}: an array of shape {numbers.shape}; expected (n,)")
    return numbers
