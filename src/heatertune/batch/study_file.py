"""STUDY.toml → cases: every combination of a grid, and cases listed one by one."""

from __future__ import annotations

import math
import tomllib
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass
from itertools import product
from pathlib import Path
from typing import Any, Final, NamedTuple

from heatertune.chain.words import WAYS
from heatertune.errors import DocumentError, UnknownName
from heatertune.files import read_text
from heatertune.pid.specs import OBJECTIVES
from heatertune.pid.tune import METHODS, STRUCTURES
from heatertune.plc import TARGETS, room
from heatertune.plc.open_points import settings_of
from heatertune.proof.interlock import INTERLOCKS
from heatertune.proof.pwm import RULES

__all__ = ["KEYS", "Key", "Study", "read_study"]


class Key(NamedTuple):
    """What a case may set: a text (one of `known`, where these are given), a float, a count, or a table of texts."""

    kind: str
    what: str
    known: Sequence[str] = ()


def _float(what: str) -> Key:
    return Key("float", what)


#: every key of a study, in the order of the chain
KEYS: Final[Mapping[str, Key]] = {
    "log": Key("text", "a log to fit: a CSV file, table3 or table4"),
    "model": Key("text", "model.json as written by fit"),
    "gain_degC_per_pct": _float("process gain of a model by hand [°C/%]"),
    "time_constant_s": _float("its time constant [s]"),
    "second_time_constant_s": _float("its second time constant [s]"),
    "dead_time_s": _float("its dead time [s]"),
    "ambient_degC": _float("temperature without power, of a model by hand or known to the fit [°C]"),
    "power_before_pct": _float("power before the log's first reading [%]"),
    "until_s": _float("last instant of the log to use [s]"),
    "target": Key("text", "the controller", tuple(TARGETS)),
    "structure": Key("text", "parts that act", STRUCTURES),
    "method": Key("text", "optimum or a rule", METHODS),
    "closed_loop_s": _float("closed-loop time constant of a rule [s]"),
    "objective": Key("text", "what the optimum minimises", tuple(OBJECTIVES)),
    "weight": _float("share of the setpoint IAE"),
    "ms": _float("largest Ms of the optimum"),
    "mt": _float("largest Mt of the optimum"),
    "mks": _float("largest Mks of the optimum [%/°C]"),
    "sample_time_s": _float("sampling interval TA [s]"),
    "words": Key("text", "how the words are found", WAYS),
    "range_low_degC": _float("temperature at the sensor's lowest reading [°C]"),
    "range_high_degC": _float("temperature at the sensor's highest reading [°C]"),
    "switches": Key("table", "settings of points that the manual leaves open"),
    "setpoint_degC": _float("setpoint of the proof [°C]"),
    "noise_degC": _float("sensor noise, standard deviation [°C]"),
    "tolerance_degC": _float("how far from the setpoint is still right [°C]"),
    "pwm_period_s": _float("PWM period [s]"),
    "pwm_resolution_s": _float("the on time is a multiple of it [s]"),
    "minimum_on_s": _float("shortest on time [s]"),
    "minimum_off_s": _float("shortest off time [s]"),
    "pwm_rule": Key("text", "block that makes the PWM", tuple(RULES)),
    "interlock": Key("text", "what may open the heater's circuit", tuple(INTERLOCKS)),
    "limit_degC": _float("temperature at which it does [°C]"),
    "fan_stops_s": _float("instant at which its fan fails [s]"),
    "samples": Key("int", "drawn heaters on which the words are proven, too"),
}

_EXPECTED: Final = {
    "float": "a finite number", "int": "a whole number, 0 or more", "text": "a text", "table": "a table of name = text",
}
_PARTS: Final = ("fixed", "grid", "case")
_SOURCES: Final = ("log", "model", "gain_degC_per_pct")
_BY_HAND: Final = ("gain_degC_per_pct", "time_constant_s", "dead_time_s")
#: key → the one without which it means nothing
_NEEDS: Final = {
    "second_time_constant_s": "gain_degC_per_pct", "time_constant_s": "gain_degC_per_pct",
    "dead_time_s": "gain_degC_per_pct", "power_before_pct": "log", "until_s": "log",
    "pwm_resolution_s": "pwm_period_s", "minimum_on_s": "pwm_period_s", "minimum_off_s": "pwm_period_s",
    "pwm_rule": "pwm_period_s", "limit_degC": "interlock", "fan_stops_s": "interlock",
}


@dataclass(frozen=True, slots=True, kw_only=True)
class Study:
    """The cases of a study: the grid's, its first key varying slowest, then the listed ones; made when asked for.

    Attributes:
        fixed: what all cases share, unless a listed one sets it itself.
        grid: key → settings.
        listed: what each listed case sets.
    """

    fixed: Mapping[str, Any]
    grid: Mapping[str, Sequence[Any]]
    listed: Sequence[Mapping[str, Any]]

    @property
    def keys(self) -> list[str]:
        """The keys that any case sets, in the order of `KEYS`."""
        used = {*self.fixed, *self.grid, *(key for case in self.listed for key in case)}
        return [key for key in KEYS if key in used]

    def settings_of(self, key: str) -> list[Any]:
        """Return every setting of a key, each once, in the order of the file."""
        single = [each[key] for each in (self.fixed, *self.listed) if key in each]
        return list(dict.fromkeys([*single, *self.grid.get(key, ())]))

    def __len__(self) -> int:
        return self._combinations + len(self.listed)

    def case(self, number: int) -> Mapping[str, Any]:
        """Return what a case sets; the first is number 0."""
        if number >= self._combinations:
            return {**self.fixed, **self.listed[number - self._combinations]}
        chosen: dict[str, Any] = {}
        for key in reversed(list(self.grid)):
            number, which = divmod(number, len(self.grid[key]))
            chosen[key] = self.grid[key][which]
        return {**self.fixed, **chosen}

    @property
    def _combinations(self) -> int:
        return math.prod(map(len, self.grid.values())) if self.grid else 0


def read_study(path: str | Path) -> Study:
    """Return the cases of a study.

    The file has up to three parts: ``[fixed]`` what all cases share, ``[grid]`` lists of which every combination is a
    case, ``[[case]]`` one further case each. Their keys are those of `KEYS`.

    Raises:
        DocumentError: no such file, no TOML, an unknown key, a setting of the wrong type, an unknown name, an empty
            list, a case without heater or target.
    """
    try:
        content = tomllib.loads(read_text(path))
    except OSError as problem:
        raise DocumentError(f"{path}: cannot be read: {problem.strerror}") from problem
    except (ValueError, RecursionError) as problem:  # no UTF-8, no TOML, thousands of digits or brackets
        raise DocumentError(f"{path}: no TOML: {problem}") from problem
    for part in content:
        _demand_known(path, "part", part, _PARTS)
    study = Study(
        fixed=_settings(f"{path}, [fixed]", content.get("fixed", {})),
        grid=_grid(f"{path}, [grid]", content.get("grid", {})),
        listed=_listed(path, content.get("case", [])),
    )
    if not len(study):
        raise DocumentError(f"{path}: no case; expected [grid] with lists, or [[case]]")
    for where, case in _shapes(path, study):
        _check(where, case)
    return study


def _grid(where: str, found: object) -> dict[str, list[Any]]:
    lists: dict[str, list[Any]] = {}
    for key, settings in _table(where, found).items():
        _demand_known(where, "key", key, KEYS)
        if not isinstance(settings, list) or not settings:
            raise DocumentError(f"{where}: {key} is {settings!r}; expected a list of at least one setting")
        lists[key] = [_setting(where, key, each) for each in settings]
        if any(each in lists[key][:k] for k, each in enumerate(lists[key])):
            raise DocumentError(f"{where}: {key} is {settings!r}; expected each setting once")
    return lists


def _listed(path: str | Path, found: object) -> list[dict[str, Any]]:
    if not isinstance(found, list):
        raise DocumentError(f"{path}: case is {found!r}; expected [[case]], once per case")
    return [_settings(f"{path}, [[case]] {k}", each) for k, each in enumerate(found, start=1)]


def _settings(where: str, found: object) -> dict[str, Any]:
    settings = _table(where, found)
    for key in settings:
        _demand_known(where, "key", key, KEYS)
    return {key: _setting(where, key, value) for key, value in settings.items()}


def _table(where: str, found: object) -> dict[str, Any]:
    if not isinstance(found, dict):
        raise DocumentError(f"{where}: {found!r}; expected a table of key = setting")
    return found


def _setting(where: str, key: str, value: Any) -> Any:
    """Return a setting, numbers as floats."""
    kind, _, known = KEYS[key]
    if kind == "float" and isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value):
        return float(value)
    if kind == "int" and isinstance(value, int) and not isinstance(value, bool) and value >= 0:
        return value
    if kind == "text" and isinstance(value, str):
        if known:
            _demand_known(where, key, value, known)
        return value
    if kind == "table" and isinstance(value, dict) and all(isinstance(each, str) for each in value.values()):
        return value
    expected = _EXPECTED[kind]
    many = " (lists belong in [grid])" if isinstance(value, list) else ""
    raise DocumentError(f"{where}: {key} is {value!r}; expected {expected}{many}")


def _demand_known(where: str | Path, kind: str, name: str, known: Any) -> None:
    if name not in known:
        raise DocumentError(f"{where}: {UnknownName(kind, name, known)}")


def _shapes(path: str | Path, study: Study) -> Iterator[tuple[str, Mapping[str, Any]]]:
    """Return one case of each shape with its place: those that differ only in numbers need no second look."""
    if study.grid:
        chosen = {key: settings if key in ("target", "switches") else settings[:1]
                  for key, settings in study.grid.items()}
        for each in product(*chosen.values()):
            yield f"{path}, [grid]", {**study.fixed, **dict(zip(chosen, each, strict=True))}
    for k, case in enumerate(study.listed, start=1):
        yield f"{path}, [[case]] {k}", {**study.fixed, **case}


def _check(where: str, case: Mapping[str, Any]) -> None:
    """Refuse a case without a heater or a target, or with a key that needs another one."""
    sources = [key for key in _SOURCES if key in case]
    if len(sources) != 1:
        told = " and ".join(sources) or "no heater"
        raise DocumentError(f"{where}: {told}; expected one of {', '.join(_SOURCES)}")
    if "target" not in case:
        raise DocumentError(f"{where}: no target; expected one of {', '.join(TARGETS)}")
    for key, needed in _NEEDS.items():
        if key in case and needed not in case:
            raise DocumentError(f"{where}: {key} without {needed}, which it belongs to")
    missing = [key for key in _BY_HAND if key not in case]
    if "gain_degC_per_pct" in case and missing:
        raise DocumentError(f"{where}: no {missing[0]}; a model by hand needs {', '.join(_BY_HAND)}")
    try:
        settings_of(room(case["target"]).switches, case.get("switches", {}))
    except UnknownName as problem:
        raise DocumentError(f"{where}: {case['target']}: {problem}") from problem
