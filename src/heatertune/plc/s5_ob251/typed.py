"""How the controller DB is typed in: in manual first, what the numbers mean, and W as it was proven."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any, Final

from heatertune.plc.ramp import Number
from heatertune.plc.s5_ob251.blocks import WORK
from heatertune.plc.s5_ob251.step import AUTO, FULL_SCALE
from heatertune.plc.words import Words
from heatertune.units import written

__all__ = ["keyed_entries", "setpoint_entry"]

_FROM: Final = f"DW 0 of DB{WORK}"
_SMALL: Final = 200  # units of YH: a tenth of the power, see COMMISSIONING.md


def keyed_entries(words: Words, setpoint_degC: float | None, units: Number | None) -> Mapping[str, Mapping[str, Any]]:
    """Return what is typed otherwise than it stands in the words, see `heatertune.plc.keyed_entry.TypedWord`.

    Args:
        words: of OB251.
        setpoint_degC: as proven [°C]; None: nothing is.
        units: the same as W.
    """
    v = words.whole
    return {
        "K": {"meaning": f"K·R = {v['K'] * v['R'] / 1024**2:.5g} units per unit"},
        "TI": {"meaning": _integral_time(words)},
        "TD": {"meaning": _derivative_time(words)},
        "W": _setpoint(words, setpoint_degC, units),
        "STEU": {"first": v["STEU"] & ~AUTO, "meaning": "control word; bit 0: automatic"},
        "YH": {"first": min(_SMALL, v["BGOG"])},
    }


def _integral_time(words: Words) -> str:
    v = words.whole
    return f"TN = {written(words.sample_time_s * v['R'] / v['TI'])} s" if v["TI"] else "no integral action"


def _derivative_time(words: Words) -> str:
    v = words.whole
    if not v["TD"]:
        return "no derivative action"
    return f"TV = {written(words.sample_time_s * v['TD'] * 1024 / v['R'])} s" if v["R"] else f"TV = {v['TD']} TA/R"


def _setpoint(words: Words, setpoint_degC: float | None, units: Number | None) -> dict[str, Any]:
    """Return W with the factor for others; a ramp leads it to what the program asks for."""
    scale = words.scaling
    factor = f"whole part of ({FULL_SCALE}/{scale.span_degC:g})·({scale.formula})"
    if units is None:
        return {"meaning": f"setpoint, {_FROM}: {factor}, enter yours there"}
    proven = f"{setpoint_degC:g} °C as proven; others: {factor}"
    if words.ramp is not None:
        return {"meaning": f"led to the setpoint, {_FROM} = {units:+d}: {proven}"}
    return {"first": units, "then": units, "meaning": f"setpoint, {_FROM}: {proven}"}


def setpoint_entry(_words: Words, _setpoint_degC: float, units: int) -> str:
    """Return the setpoint as a person enters it, see `heatertune.plc.controller.Controller`."""
    return f"DW 0 of DB31 = {units:+d}"
