"""Words → a Python module: simple-pid's object, and a loop that switches the heater in windows of time.

The words in a Python module: its one call of PID, with numbers or constants of the module, which is not run.

What the Python module sets: simple-pid's words, its own boost and window of time.
"""

from __future__ import annotations

import ast
import math
import warnings
from collections.abc import Callable, Mapping
from typing import Any, Final

from heatertune.errors import InputError
from heatertune.plc.exported import TextSettings
from heatertune.plc.parallel.window import PwmWindow, settings_of, window_of
from heatertune.plc.parallel.words import decimal
from heatertune.plc.readback import ReadBack, WordCollector, wrong
from heatertune.plc.simple_pid.step import SimplePidAssumptions
from heatertune.plc.simple_pid.words import FIELDS
from heatertune.plc.words import Certificate, Words

__all__ = ["export_words", "from_text", "loaders"]


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


_FILE: Final = "simple_pid_heater.py"


def loaders(files: Mapping[str, str | bytes], assume: SimplePidAssumptions) -> dict[str, Callable[[], TextSettings]]:  # noqa: ARG001
    """Return what reads the module, which is not run."""
    return {_FILE: lambda: _settings(str(files[_FILE]))}


def _settings(text: str) -> TextSettings:
    values = from_text(text, None, _FILE).values
    numbers = {target.id: float(node.value.value) for node in ast.parse(text).body
               if isinstance(node, ast.Assign) and isinstance(node.value, ast.Constant)
               and isinstance(node.value.value, int | float) for target in node.targets if isinstance(target, ast.Name)}
    return settings_of(values, numbers, numbers["SETPOINT_DEGC"], ("BOOST_WITHIN_DEGC", "BOOST_AGAIN_DEGC"), text)


_MODULE = '''
import math
import time

from simple_pid import PID

SETPOINT_DEGC = {setpoint}
PERIOD_MS = {period}
WINDOW_MS = {window}
STEP_MS = {step}
LEAST_ON_MS = {on}
LEAST_OFF_MS = {off}
{distances}

def controller():
    """Return the controller as it was proven; it has to be called each PERIOD_MS with the interval in seconds."""
    return PID(
        Kp={kp}, Ki={ki}, Kd={kd}, setpoint=SETPOINT_DEGC, sample_time=None,
        output_limits=(0.0, {high}), proportional_on_measurement={p_on}, differential_on_measurement={d_on},
    )


def pulse_ms(output):
    """Return how long the heater is on in one window for an output in percent; what is no number is off."""
    if not output > 0.0:
        return 0
    wanted = output / 100.0 * WINDOW_MS
    on = STEP_MS * math.floor(wanted / STEP_MS + 0.5)
    if min(wanted, on) < LEAST_ON_MS:
        return 0
    return WINDOW_MS if max(wanted, on) > WINDOW_MS - LEAST_OFF_MS else on


{far}def run(read_degC, switch, clock=time.monotonic, sleep=time.sleep):
    """Control for ever; switch(False) in the end, whatever ends it.

    read_degC() returns the temperature, NaN where the sensor is broken; switch(on) puts the heater on or off.
    """
    pid, output, called, due, began, on_ms = None, None, None, clock(), None, 0
    try:
        while True:
            now = clock()
            if now >= due:
                reading = read_degC()
                if math.isnan(reading):  # a broken sensor: off, and from cold when it is back
                    pid, output, began = None, None, None
{boost}                else:
                    pid, dt = (controller(), PERIOD_MS / 1000.0) if pid is None else (pid, now - called)
                    output, called = pid(reading, dt=dt), now
                due = max(due + PERIOD_MS / 1000.0, now)
            if output is None:
                switch(False)
            else:
                if began is None or round(1000.0 * (now - began)) >= WINDOW_MS:
                    began = now if began is None else began + WINDOW_MS / 1000.0
                    on_ms = pulse_ms(output)
                switch(round(1000.0 * (now - began)) < on_ms)
            sleep(STEP_MS / 1000.0)
    finally:
        switch(False)
'''

_FAR = '''\
def far(reading, free):
    """Return whether the heater gets full power, free telling whether no controller has it."""
    return (BOOST_WITHIN_DEGC if free else BOOST_AGAIN_DEGC) < SETPOINT_DEGC - reading < math.inf


'''

_BOOST = '''\
                elif far(reading, pid is None):  # full power, and from cold where the controller takes over
                    pid, output = None, {high}
'''


def export_words(words: Words, certificate: Certificate) -> dict[str, str]:
    """Return the module; the same words and certificate give the same bytes."""
    window, values = window_of(words, certificate), words.values
    setpoint = words.scaling.low_degC if certificate.setpoint_degC is None else certificate.setpoint_degC
    high = decimal(values["output_max"], "LREAL")
    head = "\n".join(f"# {line}" for line in _head(words, certificate, window))
    body = _MODULE.format(
        setpoint=decimal(setpoint, "LREAL"), period=words.whole["PERIOD_MS"], window=window.period_ms,
        step=window.step_ms, on=window.least_on_ms, off=window.least_off_ms,
        kp=decimal(values["Kp"], "LREAL"), ki=decimal(values["Ki"], "LREAL"), kd=decimal(values["Kd"], "LREAL"),
        high=high, p_on=values["proportional_on_measurement"] != 0,
        d_on=values["differential_on_measurement"] != 0, distances=_distances(words),
        far=_FAR if words.boost else "", boost=_BOOST.format(high=high) if words.boost else "")
    return {"simple_pid_heater.py": head + "\n" + body}


def _distances(words: Words) -> str:
    if words.boost is None:
        return ""
    return (f"BOOST_WITHIN_DEGC = {decimal(words.boost.within_degC, 'LREAL')}\n"
            f"BOOST_AGAIN_DEGC = {decimal(words.boost.again_degC, 'LREAL')}\n")


def _head(words: Words, certificate: Certificate, window: PwmWindow) -> tuple[str, ...]:
    scale = words.scaling
    return (
        "heater controller for Python's simple-pid 2.0.1",
        f"sensor {scale.low_degC:g}...{scale.high_degC:g} degC; TA: {words.sample_time_s:g} s; output in percent",
        *certificate.head,
        window.summary,
        "remains to be done by hand: run(read_degC, switch) with your sensor and your heater's switch; pulses end with",
        "  a round of the loop, late by up to STEP_MS and what your reading takes",
    )
