"""The words in a Python module: its one call of PID, with numbers or constants of the module, which is not run."""

from __future__ import annotations

import ast
import math
import warnings
from typing import Any, Final

from heatertune.errors import InputError
from heatertune.plc.readback import ReadBack, WordCollector, wrong
from heatertune.plc.simple_pid.words import FIELDS

__all__ = ["from_text"]

#: in the order in which the class takes them
_ORDER: Final = (
    "Kp", "Ki", "Kd", "setpoint", "sample_time", "output_limits", "auto_mode", "proportional_on_measurement",
    "differential_on_measurement", "error_map", "time_fn", "starting_output")
_USUAL: Final = {"Kp": 1.0, "Ki": 0.0, "Kd": 0.0, "sample_time": 0.01, "output_limits": (None, None), "auto_mode": True,
                 "proportional_on_measurement": False, "differential_on_measurement": True, "error_map": None,
                 "starting_output": 0.0}
_SWITCHES: Final = ("proportional_on_measurement", "differential_on_measurement")
_PERIOD: Final = "PERIOD_MS"


def from_text(text: str, sample_time_s: float | None, source: str) -> ReadBack:
    """Return the words in a module.

    Raises:
        InputError: no Python, no call of PID or several; an argument that is no number, out of its range, or of a part
            that is not proven here; no interval.
    """
    tree = _parsed(text, source)
    calls = [node for node in ast.walk(tree) if isinstance(node, ast.Call) and _named(node.func) == "PID"]
    if len(calls) != 1:
        raise InputError(f"{source}: {len(calls) or 'no'} calls of PID; expected one, such as PID(2.0, 0.1, 0.0, "
                         "output_limits=(0, 100))")
    known = {target.id: node.value for node in tree.body if isinstance(node, ast.Assign) for target in node.targets
             if isinstance(target, ast.Name)}
    call = calls[0]
    given = _arguments(call, known, source)
    collected = WordCollector(source, FIELDS)
    for name in ("Kp", "Ki", "Kd"):
        collected.put(name, _number(given[name]), call.lineno, str(given[name]))
    for name in _SWITCHES:
        collected.put(name, int(given[name]) if isinstance(given[name], bool) else None, call.lineno, str(given[name]))
    limits = given["output_limits"]
    if not isinstance(limits, tuple) or len(limits) != 2 or _number(limits[0]) != 0.0:
        raise wrong(source, call.lineno, "output_limits", str(limits), "0 and a number up to 100, %")
    collected.put("output_max", _number(limits[1]), call.lineno, str(limits[1]))
    slow = given["sample_time"]
    over = () if slow is None else (f"sample_time = {slow}: calls that come sooner are left out, which is not run",)
    period = _value(known[_PERIOD], known) if _PERIOD in known else None
    if period is None and sample_time_s is not None:
        period = round(1000.0 * sample_time_s)
    if period is not None:
        collected.put(_PERIOD, period, call.lineno, str(period))
    return ReadBack(collected.values(), over)


def _parsed(text: str, source: str) -> ast.Module:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return ast.parse(text)
    except (SyntaxError, ValueError, RecursionError, MemoryError) as problem:
        line = getattr(problem, "lineno", None)
        raise InputError(f"{source}{'' if line is None else f', line {line}'}: no Python; expected a module that calls "
                         "PID of simple-pid") from problem


def _arguments(call: ast.Call, known: dict[str, ast.expr], source: str) -> dict[str, Any]:
    """Return all arguments of a call, by name."""
    names = [*_ORDER[: len(call.args)], *(keyword.arg for keyword in call.keywords)]
    if len(call.args) > len(_ORDER) or any(name not in _ORDER for name in names) or len(set(names)) != len(names):
        raise wrong(source, call.lineno, "PID", ast.unparse(call)[:60], f"{', '.join(_ORDER)}")
    values = [*call.args, *(keyword.value for keyword in call.keywords)]
    given = _USUAL | {str(name): _value(value, known) for name, value in zip(names, values, strict=True)}
    for name in ("auto_mode", "error_map", "starting_output"):
        if given[name] != _USUAL[name]:
            raise wrong(source, call.lineno, name, str(given[name]), f"{_USUAL[name]}: no other is proven here")
    return given


def _named(function: ast.expr) -> str:
    if isinstance(function, ast.Attribute):
        return function.attr
    return function.id if isinstance(function, ast.Name) else ""


def _value(node: ast.expr, known: dict[str, ast.expr]) -> Any:
    """Return what an expression is, where it is a constant or the name of one; else its text, which no word takes."""
    if isinstance(node, ast.Name) and node.id in known:
        node = known[node.id]
    if isinstance(node, ast.Tuple | ast.List):
        return tuple(_value(each, known) for each in node.elts)
    try:
        return ast.literal_eval(node)
    except (ValueError, TypeError, SyntaxError, RecursionError, MemoryError):
        return ast.unparse(node)[:60]


def _number(value: Any) -> float | None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None
