"""Python's simple-pid: its words, its law (`TERMS` of `firmware.parallel`), and the module around it.

The words are arguments of its class PID and the interval of the loop that calls it; the law is that of pid.py, 2.0.1.
"""

from __future__ import annotations

import ast
import math
import re
import textwrap
import warnings
from collections.abc import Iterator, Mapping, Sequence
from typing import Annotated, Any, Final, NamedTuple

from heatertune.errors import InputError
from heatertune.pid.design_values import Timer
from heatertune.plc.exported import TextSettings
from heatertune.plc.firmware.firmware_pid import FirmwarePid, controller_of, gain_fields, texts_of
from heatertune.plc.firmware.firmware_text import (
    calls_open_point,
    commented,
    decimal,
    sensor_line,
    setpoint_of,
    settings_of,
    window_of,
)
from heatertune.plc.firmware.parallel import (
    COLD,
    NOBODY,
    PARALLEL,
    TERMS,
    ParallelParameters,
    ParallelState,
    again,
    clamp,
    compute_call,
    scan_result,
    step,
)
from heatertune.plc.ramp import Number
from heatertune.plc.readback import ReadBack, WordCollector, wrong
from heatertune.plc.words import Certificate, WordField, Words

__all__ = ["SimplePid"]

#: output of full power
FULL: Final = 100.0
_GAIN_NAMES: Final = ("Kp", "Ki", "Kd")
_P_ON, _D_ON = "proportional_on_measurement", "differential_on_measurement"

GAINS: Final = gain_fields(_GAIN_NAMES, "PID", "LREAL", (
    "proportional gain, % per °C", "integral gain Kp/TN, per second", "derivative gain Kp·TV, seconds"))
SETTINGS: Final = (
    WordField(name="output_max", address="output_limits", format="LREAL", low=0.001, high=FULL,
              comment="upper limit of the output, %; the lower one is 0"),
    *(WordField(name=name, address="PID", format="BYTE", low=0, high=1, comment="1 True, 0 False")
      for name in (_P_ON, _D_ON)),
    WordField(name="PERIOD_MS", address="loop", format="TIME", low=10, high=600000,
              comment="interval of the calls, ms"),
)
FIELDS: Final = (*GAINS, *SETTINGS)


def _oddities(v: Mapping[str, Number]) -> Iterator[str]:
    if v[_P_ON] == 1:
        yield "P is on the measurement: it is no standard form, and its sum has no limits."
    if v[_D_ON] == 0:
        yield "D is on the error: a step of the setpoint kicks the output."
    if v["output_max"] < FULL:
        yield f"The output is limited to {v['output_max']:g} %."


class SimplePidAssumptions(NamedTuple):
    """The points that depend on the computer, see DIFFERENCES.md."""

    late: Annotated[bool, calls_open_point(
        "calls come on time, or every tenth call comes after twice the interval, which the loop measures")] = False


def _parameters(values: Mapping[str, float], assume: SimplePidAssumptions) -> ParallelParameters:
    """Return the words as the object keeps them."""
    high = float(values["output_max"])
    return ParallelParameters(
        law=TERMS, narrow=False, kp=float(values["Kp"]), ki=float(values["Ki"]), kd=float(values["Kd"]), low=0.0,
        high=high, least=0.0, most=high, full=100.0, interval=values["PERIOD_MS"] / 1000.0, late=assume.late,
        on_measurement=values[_P_ON] != 0, on_error=values[_D_ON] == 0)


def _scan(
    p: ParallelParameters, s: ParallelState, inputs: Mapping[str, float]
) -> tuple[ParallelState, float, float, int]:
    """Compute one call; where named, auto_mode 0 keeps the output, last_output begins I, dt is the interval [s].

    An interval that is none is refused by the package, and leaves all as it was.
    """
    if not inputs.get("auto_mode", 1):
        return scan_result(p, again(s, True, s.output, 1.0, NOBODY))
    if s.begins and s.waited:  # back from manual: the I part begins where it is told
        integral = clamp(float(inputs.get("last_output", 0.0)), p.least, p.most)
        s = ParallelState(True, s.calls, integral, 0.0, 0.0, 0.0, 0.0, 0.0, s.output, 0.0)
    setpoint, reading = float(inputs["setpoint"]), float(inputs["input_"])
    if "dt" not in inputs:
        return step(p, s, setpoint, reading, True)
    interval = float(inputs["dt"])
    return scan_result(p, compute_call(p, s, setpoint, reading, interval) if interval > 0.0 else s)


#: in the order in which the class takes them
_ORDER: Final = (
    "Kp", "Ki", "Kd", "setpoint", "sample_time", "output_limits", "auto_mode", _P_ON,
    _D_ON, "error_map", "time_fn", "starting_output")
#: sample_time where none is given: the object is called no faster [s]
_FASTEST_S: Final = 0.01
_USUAL: Final = {"Kp": 1.0, "Ki": 0.0, "Kd": 0.0, "sample_time": _FASTEST_S, "output_limits": (None, None),
                 "auto_mode": True, _P_ON: False, _D_ON: True, "error_map": None, "starting_output": 0.0}
_PERIOD: Final = "PERIOD_MS"
#: name of a constant that says which output is full power; upper limits that are taken for it where none does
_FULL: Final = "FULL"
_SCALES: Final = (1.0, FULL, 255.0, 1023.0, 4095.0, 65535.0)
_TUNINGS: Final = "tunings"
#: what MicroPython, CircuitPython and libraries of converters give: counts
_COUNTS: Final = re.compile(
    r"(?:[\w.]*\.)?(?:read_u16|read_adc|analog_?read)\(.*\)|\w*adc\w*\.(?:read\(\)|value)", re.IGNORECASE)
_FAHRENHEIT: Final = re.compile(r"fahrenheit|_f\b", re.IGNORECASE)
#: what may be set after the call, as attributes of the object
_LATER: Final = (*_GAIN_NAMES, _TUNINGS, "sample_time", "output_limits", _P_ON, _D_ON)
_PROMPT: Final = re.compile(r"^(?:>>> ?|\.\.\. ?|In \[\d+\]: ?)", re.MULTILINE)
_TOLD: Final = re.compile(rf"\bPID\s*\(|\b(?:{'|'.join(_LATER)}|{_FULL}|{_PERIOD})\b")


def from_text(text: str, sample_time_s: float | None, source: str) -> ReadBack:
    """Return the words in a module, or in lines of one; gains and limit in percent of full power.

    Raises:
        InputError: no Python, no call of PID or several; an argument that is no number, out of its range, or of a part
            that is not proven here; an output whose full power is not constants; no interval.
    """
    try:
        return _read(_parsed(text, source), sample_time_s, source)
    except RecursionError as problem:
        raise InputError(f"{source}: expressions nested too deep; expected a call of PID with numbers") from problem


def _read(body: Sequence[ast.stmt], sample_time_s: float | None, source: str) -> ReadBack:
    calls = [node for statement in body for node in ast.walk(statement) if isinstance(node, ast.Call)
             and _named(node.func) == "PID"]
    if len(calls) != 1:
        raise InputError(f"{source}: {len(calls) or 'no'} calls of PID; expected one, such as PID(2.0, 0.1, 0.0, "
                         "output_limits=(0, 100))")
    constants, call = _constants(body), calls[0]
    arguments, lines = _arguments(call, constants, source), dict.fromkeys(_ORDER, call.lineno)
    unstated = {name for number, name in enumerate(_GAIN_NAMES)
                if number >= len(call.args) and all(keyword.arg != name for keyword in call.keywords)}
    for line, name, value in _set_later(body, call, constants, arguments, source):
        arguments[name], lines[name] = value, line
        unstated.discard(name)
    collected, gains = WordCollector(source, FIELDS), {name: _number(arguments[name]) for name in _GAIN_NAMES}
    for name in (name for name, gain in gains.items() if gain is None):
        collected.put(name, None, lines[name], str(arguments[name]))
    most, full, assumed = _output(arguments["output_limits"], lines["output_limits"], constants, source)
    collected.put("output_max", most, lines["output_limits"], str(arguments["output_limits"]))
    for name, gain in gains.items():
        collected.put(name, None if gain is None else gain * (FULL / full), lines[name], str(arguments[name]))
    for name in (_P_ON, _D_ON):
        value = arguments[name]
        collected.put(name, int(value) if isinstance(value, bool) else None, lines[name], str(value))
    period, period_notes = _period(arguments["sample_time"], body, constants, sample_time_s)
    collected.put(_PERIOD, period, call.lineno, str(period))
    slow = arguments["sample_time"]
    assumed += [f"{name} = {arguments[name]:g}" for name in _GAIN_NAMES if name in unstated]
    over = () if slow is None else (f"sample_time = {slow}: calls that come sooner are left out, which is not run",)
    return ReadBack(collected.values(), over, assumed=(*assumed, *period_notes, *_other_unit(body, call)))


def _other_unit(body: Sequence[ast.stmt], constructor: ast.Call) -> list[str]:
    """Return that the reading is taken to be in °C, where the program has counts of a converter, or °F."""
    for call in _calls_of(body, constructor):
        shown = "".join(ast.unparse(argument) for argument in call.args[:1])
        if _FAHRENHEIT.search(shown) or _COUNTS.fullmatch(shown):
            unit, factor = ("°F", "1.8") if _FAHRENHEIT.search(shown) else ("counts", "the counts per °C")
            return [f"the reading in °C, not {unit} as {shown[:40]} has (else multiply each gain by {factor})"]
    return []


def _calls_of(body: Sequence[ast.stmt], constructor: ast.Call) -> list[ast.Call]:
    """Return the calls of the object that a constructor makes."""
    nodes = [node for each in body for node in ast.walk(each)]
    own = [_named(node.targets[0]) for node in nodes if isinstance(node, ast.Assign) and node.value is constructor]
    return [node for node in nodes if isinstance(node, ast.Call) and _named(node.func) in own]


def _output(
    limits: object, line: int, constants: Mapping[str, ast.AST], source: str,
) -> tuple[float, float, list[str]]:
    """Return the upper limit in percent, the output at full power, and what is assumed of it."""
    low, high = map(_number, limits) if isinstance(limits, tuple) and len(limits) == 2 else (None, None)
    if low != 0.0 or high is None or not high > 0.0:
        raise wrong(source, line, "output_limits", str(limits), "0 and the output at full power, such as "
                    "pid.output_limits = (0, 100): without limits, or with others below, nothing is proven here")
    is_stated = _FULL in constants or _PERIOD in constants
    full = high if high in _SCALES else None
    if is_stated:
        full = _number(_value(constants[_FULL], constants)) if _FULL in constants else FULL
    if full is None or not full > 0.0:
        raise wrong(source, line, "output_limits", str(limits), f"an upper limit of 1, 100 or 255; with another one "
                    f"add a line {_FULL} = {high:g} with the output at full power")
    assumed = [] if is_stated or high == FULL else [f"output {high:g} = full power"]
    return high * (FULL / full), full, assumed


def _period(
    slow: object, body: Sequence[ast.stmt], constants: Mapping[str, ast.AST], sample_time_s: float | None,
) -> tuple[Any, list[str]]:
    """Return the interval of the calls [ms], and what is assumed of it.

    Raises:
        InputError: nothing says how often the object is called.
    """
    if _PERIOD in constants:
        return _value(constants[_PERIOD], constants), []
    if sample_time_s is not None:
        return round(1000.0 * sample_time_s), []
    sleeps = [_number(_value(node.args[0], constants)) for each in body for node in ast.walk(each)
              if isinstance(node, ast.Call) and _named(node.func) == "sleep" and node.args]
    waits = [each for each in (_number(slow), *sleeps) if each is not None and each > _FASTEST_S]
    if not waits or len(sleeps) > 1 or None in sleeps:
        raise InputError("--called-every is needed: the text does not say how often the object is called")
    return round(1000.0 * max(waits)), [f"called every {max(waits):g} s"]


def _parsed(text: str, source: str) -> list[ast.stmt]:
    """Return the statements of a text; of one that is no whole module, the lines that are statements."""
    plain = textwrap.dedent(_PROMPT.sub("", text))
    body, problem = _statements_of(plain)
    if problem is None:
        return body
    for number, code in _logical_lines(plain):
        part, wrong_part = _statements_of(code.strip())
        if wrong_part is not None and _TOLD.search(code):
            raise InputError(f"{source}, line {number}: no Python; expected a module that calls PID of simple-pid, or "
                             "lines of it") from wrong_part
        body += [ast.increment_lineno(node, number - 1) for node in part]
    if not any(_TOLD.search(line) for _, line in _logical_lines(plain)):
        raise InputError(f"{source}, line {getattr(problem, 'lineno', None) or 1}: no Python; expected a module that "
                         "calls PID of simple-pid") from problem
    return body


def _statements_of(text: str) -> tuple[list[ast.stmt], Exception | None]:
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")
            return ast.parse(text).body, None
    except (SyntaxError, ValueError, RecursionError, MemoryError) as problem:
        return [], problem


def _logical_lines(text: str) -> Iterator[tuple[int, str]]:
    """Yield lines, those joined between whose brackets a line ends, by the number of the first."""
    buffer, number = "", 1
    for count, line in enumerate(text.split("\n"), start=1):
        buffer, number = (f"{buffer}\n{line}", number) if buffer else (line, count)
        code = re.sub(r"#.*", "", buffer)
        if not any(code.count(left) > code.count(right) for left, right in ("()", "[]", "{}")):
            yield number, buffer
            buffer = ""
    if buffer:
        yield number, buffer


def _assignments(body: Sequence[ast.stmt], is_certain: bool = True) -> Iterator[tuple[ast.expr, ast.AST, bool]]:
    """Yield target, value, and whether it is set whatever happens, of all assignments."""
    for node in body:
        if isinstance(node, ast.Assign):
            for target in node.targets:
                yield from _pairs(target, node.value, is_certain)
        elif isinstance(node, ast.AugAssign | ast.AnnAssign) and node.value is not None:
            yield node.target, node if isinstance(node, ast.AugAssign) else node.value, is_certain
        certain = is_certain and (not isinstance(node, ast.If) or "__name__" in ast.unparse(node.test))
        for part in ("body", "orelse", "finalbody", "handlers"):
            yield from _assignments(getattr(node, part, ()), certain and part != "handlers")


def _pairs(target: ast.expr, value: ast.AST, is_certain: bool) -> Iterator[tuple[ast.expr, ast.AST, bool]]:
    if (isinstance(target, ast.Tuple | ast.List) and isinstance(value, ast.Tuple | ast.List)
            and len(target.elts) == len(value.elts)):
        for one, its in zip(target.elts, value.elts, strict=True):
            yield one, its, is_certain
    else:
        yield target, value, is_certain


def _constants(body: Sequence[ast.stmt]) -> dict[str, ast.AST]:
    """Return name → what it always is; a name that becomes several things has none."""
    all_: dict[str, dict[str, ast.AST]] = {}
    for target, value, _ in _assignments(body):
        if isinstance(target, ast.Name | ast.Attribute):
            all_.setdefault(ast.unparse(target), {})[ast.dump(value)] = value
    return {name: next(iter(values.values())) for name, values in all_.items() if len(values) == 1}


def _set_later(
    body: Sequence[ast.stmt], call: ast.Call, constants: Mapping[str, ast.AST], arguments: Mapping[str, object],
    source: str,
) -> Iterator[tuple[int, str, object]]:
    """Yield line, name and value of what is set after the call; refuse what is set to several values, or perhaps."""
    before, changed = dict(arguments), set[str]()
    for target, value, is_certain in _own_attributes(body, call, constants, source):
        setting, is_all = _value(value, constants), target.attr == _TUNINGS
        parts = setting if is_all and isinstance(setting, tuple) and len(setting) == len(_GAIN_NAMES) else (setting,)
        for name, part in zip(_GAIN_NAMES if is_all else (target.attr,), parts, strict=False):
            if part != before[name] and (not is_certain or name in changed):
                raise wrong(source, target.lineno, name, str(part), f"{before[name]} as before; leave in the text only "
                            "what is in force")
            before[name] = part
            changed.add(name)
            yield target.lineno, name, part


def _own_attributes(
    body: Sequence[ast.stmt], call: ast.Call, constants: Mapping[str, ast.AST], source: str,
) -> Iterator[tuple[ast.Attribute, ast.AST, bool]]:
    """Yield the assignments to attributes of the object that are words; refuse those of no object or attribute."""
    own = next((ast.unparse(target) for target, value, _ in _assignments(body) if value is call), None)
    there = {ast.unparse(target) for target, *_ in _assignments(body)} | {"self"}
    for target, value, is_certain in _assignments(body):
        if not isinstance(target, ast.Attribute):
            continue
        whose = ast.unparse(target.value)
        is_own = own in (None, whose) or _value(target.value, constants) == own
        if target.attr in _LATER and is_own:
            yield target, value, is_certain
        elif target.attr in _LATER and whose not in there:
            raise wrong(source, target.lineno, f"{whose}.{target.attr}", _shown(value), f"{own}, which PID made")
        elif whose == own and target.attr not in _ORDER:
            raise wrong(source, target.lineno, f"{own}.{target.attr}", _shown(value), ", ".join(_LATER))


def _arguments(call: ast.Call, constants: Mapping[str, ast.AST], source: str) -> dict[str, object]:
    """Return all arguments of a call, by name."""
    names = [*_ORDER[: len(call.args)], *(keyword.arg for keyword in call.keywords)]
    if len(call.args) > len(_ORDER) or any(name not in _ORDER for name in names) or len(set(names)) != len(names):
        raise wrong(source, call.lineno, "PID", ast.unparse(call)[:60], f"{', '.join(_ORDER)}")
    values = [*call.args, *(keyword.value for keyword in call.keywords)]
    by_name = _USUAL | {str(name): _value(value, constants) for name, value in zip(names, values, strict=True)}
    for name in ("auto_mode", "error_map", "starting_output"):
        if by_name[name] != _USUAL[name]:
            raise wrong(source, call.lineno, name, str(by_name[name]), f"{_USUAL[name]}: no other is proven here")
    return by_name


def _named(function: ast.expr) -> str:
    if isinstance(function, ast.Attribute):
        return function.attr
    return function.id if isinstance(function, ast.Name) else ""


def _value(node: ast.AST, constants: Mapping[str, ast.AST]) -> Any:
    """Return what an expression is, where it is a constant or the name of one; else its text, which no word takes."""
    if isinstance(node, ast.Name | ast.Attribute):
        node = constants.get(ast.unparse(node), node)
    if isinstance(node, ast.Tuple | ast.List):
        return tuple(_value(each, constants) for each in node.elts)
    try:
        return ast.literal_eval(node)
    except (ValueError, TypeError, SyntaxError, RecursionError, MemoryError):
        return ast.unparse(node)[:60]


def _shown(value: ast.AST) -> str:
    return ast.unparse(value)[:40]


def _number(value: Any) -> float | None:
    if isinstance(value, bool) or not isinstance(value, int | float):
        return None
    try:
        number = float(value)
    except OverflowError:
        return None
    return number if math.isfinite(number) else None


_FILE: Final = "simple_pid_heater.py"


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


def _export(words: Words, certificate: Certificate) -> dict[str, str | bytes]:
    """Return the module; the same words and certificate give the same bytes."""
    window, texts = window_of(words, certificate), texts_of(words, FIELDS)
    high = texts["output_max"]
    head = commented(
        "#", "heater controller for Python's simple-pid 2.0.1", sensor_line(words, "; output in percent"),
        *certificate.head, window.summary,
        "remains to be done by hand: run(read_degC, switch) with your sensor and your heater's switch; pulses end with",
        "  a round of the loop, late by up to STEP_MS and what your reading takes")
    return {_FILE: head + _MODULE.format(
        setpoint=setpoint_of(words, certificate), period=texts["PERIOD_MS"], window=window.period_ms,
        step=window.step_ms, on=window.least_on_ms, off=window.least_off_ms,
        kp=texts["Kp"], ki=texts["Ki"], kd=texts["Kd"], high=high,
        p_on=words.values[_P_ON] != 0, d_on=words.values[_D_ON] != 0, distances=_distances(words),
        far=_FAR if words.boost else "", boost=_BOOST.format(high=high) if words.boost else "")}


def _distances(words: Words) -> str:
    if words.boost is None:
        return ""
    return (f"BOOST_WITHIN_DEGC = {decimal(words.boost.within_degC, 'LREAL')}\n"
            f"BOOST_AGAIN_DEGC = {decimal(words.boost.again_degC, 'LREAL')}\n")


SimplePid = controller_of(FirmwarePid(
    name="simple-pid", title="simple-pid 2.0.1 for Python (simple_pid/pid.py)", main_file=_FILE,
    can=(
        "P, PI, PD and PID in double precision by the measured interval, D on the reading",
        "P on the measurement and D on the error where words are read",
        "exported as a Python module: the object, a loop with a boost and a window of time; a broken sensor is off",
    ),
    cannot=(
        "no derivative filter: noise and steps of the reading reach the output times Kd/interval",
        "the integral part goes on while the output is at a limit; it ends at that limit itself",
        "no coolers, no lower limit but 0, no error_map, no starting_output",
        "no setpoint ramp in the module; pulses that make up for others are left to a switch behind it",
    ),
    inputs={"setpoint": "REAL", "input_": "REAL", "auto_mode": "BOOL", "last_output": "REAL", "dt": "REAL"},
    counts=4095,  # of the 12-bit converter behind the sensor that is assumed
    timer=Timer(shortest_s=0.01, longest_s=600.0, step_s=0.01),
    gains=GAINS, settings=SETTINGS, full=FULL, usual={"output_max": FULL, _P_ON: 0, _D_ON: 1},
    interval=("PERIOD_MS", 0.001), method="as the words of simple-pid realise it", oddities=_oddities,
    measurement=(_P_ON, 1), law=PARALLEL, cold=COLD, assumptions=SimplePidAssumptions, parameters=_parameters,
    export=_export, text=from_text, settings_in={_FILE: _settings},
    further={"tick_s": 0.01, "has_boost": True, "most_power": ("output_max", FULL), "scan_all": staticmethod(_scan),
             "keyed_entries": None},
))
