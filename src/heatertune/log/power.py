"""The column of the power → percent of full power."""

from __future__ import annotations

import re
from typing import Final, NamedTuple

import numpy as np

from heatertune.errors import LogError
from heatertune.log.cells import Sheet
from heatertune.log.clock import ASSUMED
from heatertune.log.columns import Array, Columns, cell_error, numbers
from heatertune.log.quantities import is_scaled, on_or_off

__all__ = ["Power", "power_of"]

_SWITCH: Final = re.compile(
    r"relay|relais|\bssr\b|switch|schalter|[_ ](on|ein|state|status|active|aktiv)$", re.IGNORECASE)
_PWM: Final = re.compile("pwm", re.IGNORECASE)
_SMALL: Final = 12.0  # a power in percent that never exceeds this may be volts of 0…10 V or amperes
_EXPECTED: Final = "--power-full-scale with the reading at full power, or --power-column none"


class Power(NamedTuple):
    """The power [%], its reading at full power, how it was written, and which full scale is likeliest if assumed."""

    percent: Array
    full_scale: float
    written: str
    likely_full_scale: float = 100.0


def power_of(
    sheet: Sheet, columns: Columns, given: float | None, repairs: list[str], doubts: list[str]
) -> Power | None:
    """Return the power; None where the log holds none.

    Args:
        sheet: the cells.
        columns: which column is what.
        given: reading at full power, where the user says so.
        repairs: what was assumed is added here.
        doubts: what may be otherwise is added here.

    Raises:
        LogError: a cell that is no power, a power whose full scale cannot be known, one out of range.
    """
    if "power" not in columns.index:
        return None
    switched = on_or_off([row[columns.index["power"]] for row in sheet.rows])
    if switched is not None:
        repairs.append("The power is on or off; taken as 100 % and 0 %.")
        return Power(np.array(switched, dtype=np.float64) * 100.0, 1.0, "on/off")
    expected = "a number, or on and off in every row (--power-column none if there is no power)"
    values = numbers(sheet, columns, "power", expected)
    named = None if is_scaled("power", columns.names["power"]) else columns.unit("power")
    if named == "100" and "power" not in columns.units and 0.0 < float(np.max(values)) <= 1.0:
        named = None  # a column named in percent that holds shares, as a spreadsheet exports it
    full_scale = given or (float(named) if named else _assumed(sheet, columns, values, repairs, doubts))
    written = f"0…{full_scale:g} %" if full_scale == 100.0 else f"0…{full_scale:g}"
    if full_scale != 100.0:
        repairs.append(f"The power was divided by its reading at full power, {full_scale:g}.")
    outside = np.flatnonzero((values < 0.0) | (values > full_scale))
    if len(outside):
        raise cell_error(sheet, columns, "power", int(outside[0]), "power out of range:",
                      f"0…{full_scale:g} (--power-full-scale tells another reading at full power)")
    percent = values if full_scale == 100.0 else values / full_scale * 100.0
    if not (given or named):
        written += _grounds(columns.names["power"], values, full_scale)
    return Power(percent, full_scale, written, 255.0 if _PWM.search(columns.names["power"]) else 100.0)


def _grounds(name: str, values: Array, full_scale: float) -> str:
    """Return by what the full scale of a power without a unit is known: as a switch, by its ends; else assumed.

    A name that speaks of counts or of multiples, PWM or x10, contradicts the ends.
    """
    if full_scale == 1.0:
        return ", of a switch"
    reached = float(values.min()) == 0.0 and float(values.max()) == full_scale
    return ", both reached" if reached and not (_PWM.search(name) or is_scaled("power", name)) else ASSUMED


def _assumed(sheet: Sheet, columns: Columns, values: Array, repairs: list[str], doubts: list[str]) -> float:
    """Return 100 where the numbers can only be percent, 1 of a switch; everything else has to be told."""
    name, largest = columns.names["power"], float(np.max(values))
    if _SWITCH.search(name) and set(np.unique(values)) <= {0.0, 1.0}:
        repairs.append("The power is 0 or 1 of a switch; taken as off and on.")
        return 1.0
    why = next((why for holds, why in (
        (columns.is_foreign("power"), "in a unit that is not a share of full power"),
        (largest > 100.0, "is no percentage"),
        (0.0 < largest <= 1.0, "may be a fraction or percent"),
        (_PWM.search(name) is not None and not np.any(values % 1.0), "may be percent or counts of 255"),
    ) if holds), None)
    if why:
        raise LogError(f"a power up to {largest:g} {why}", file=sheet.file, column=name, expected=_EXPECTED)
    repairs.append("The power has no unit in the file; taken as percent (otherwise: --power-full-scale).")
    if 0.0 < largest <= _SMALL:
        doubts.append(f"The power, taken as percent, never exceeds {largest:g} %: were it volts or amperes, "
                      "--power-full-scale would have to tell the reading at full power.")
    return 100.0
