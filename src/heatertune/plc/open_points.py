"""The open points of a controller's manual, declared once: as fields of the named tuple that its step takes.

    class Assumptions(NamedTuple):
        truncates: Annotated[bool, OpenPoint(
            name="conversion", means={"rnd": False, "trunc": True}, reason="whether OUT is rounded or truncated",
        )] = False

They define the open points that users see, the settings that a proof runs, the table in DIFFERENCES.md, and the value
that the step reads. The order of the fields does not matter.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass
from functools import cache
from itertools import product
from typing import Any, Final, NamedTuple, cast, get_args, get_type_hints

from heatertune.errors import UnknownName

__all__ = ["NothingOpen", "OpenPoint", "always", "assumptions_from", "never", "open_points_of", "settings_of",
           "settings_to_prove"]

_ALL_TOGETHER: Final = 8  # up to so many combinations of settings all are run


def always(_parameters: Any) -> bool:
    """Return True: a run may show the setting of the open point, whatever the words."""
    return True


def never(_parameters: Any) -> bool:
    """Return False: no run shows the setting of the open point, because none reaches the relevant state."""
    return False


@dataclass(frozen=True, slots=True, kw_only=True)
class OpenPoint:
    """A point the manual leaves open.

    Attributes:
        name: on the command line.
        means: each setting → value of the field; the default first.
        reason: the open question, as in the table of DIFFERENCES.md.
        in_manual: whether it only shows when the mode of the controller changes, which no run of a proof does.
        summary: settings that the exported program handles by itself; they are proven only if the user selects them.
        chosen: whether the user chooses it and the export implements the choice: the proof runs the chosen setting
            and the default, to which a PLC without retention falls back.
        shows: parameters of the step → whether a run may show the setting; if not, every setting gives
            the same result, bit for bit, and only one of them is run.
    """

    name: str
    means: Mapping[str, bool | int]
    reason: str
    in_manual: bool = False
    summary: tuple[str, ...] = ()
    chosen: bool = False
    shows: Callable[[Any], bool] = always

    @property
    def settings(self) -> tuple[str, ...]:
        """The settings' names, the default first."""
        return tuple(self.means)

    @property
    def default(self) -> str:
        """The setting if nothing more is known about the controller."""
        return self.settings[0]


class NothingOpen(NamedTuple):
    """The assumptions of a step without open points."""


@cache
def open_points_of(assumptions: type[NamedTuple]) -> Mapping[str, OpenPoint]:
    """Return the open point of each field of a named tuple, in the order of the fields.

    Raises:
        TypeError: a field without a switch or with two, a default or a meaning that is not the field's, or two of one
            name or meaning.
    """
    switches = {}
    for field, hint in get_type_hints(assumptions, include_extras=True).items():
        kind, *marks = get_args(hint) or (hint,)
        if len(marks) != 1 or not isinstance(marks[0], OpenPoint):
            raise TypeError(f"{assumptions.__qualname__}.{field}: exactly one Switch expected")
        switches[field] = switch = marks[0]
        meanings = list(switch.means.values())
        if len(set(meanings)) != len(meanings) or not all(type(meaning) is kind for meaning in meanings):
            raise TypeError(f"{assumptions.__qualname__}.{field}: every setting must mean a {kind.__name__} of its own")
        if meanings[:1] != [assumptions._field_defaults.get(field)]:
            raise TypeError(f"{assumptions.__qualname__}.{field}: its default must be what its first setting means")
    if len({switch.name for switch in switches.values()}) != len(switches):
        raise TypeError(f"{assumptions.__qualname__}: two fields have one switch")
    return switches


def assumptions_from(assumptions: type[NamedTuple], stated: Mapping[str, str]) -> Any:
    """Return the named tuple for settings of its switches; those not given have their default.

    Raises:
        UnknownName: a switch or setting that is not there.
    """
    switches = open_points_of(assumptions)
    settings = settings_of(tuple(switches.values()), stated)
    meanings = {field: switch.means[settings[switch.name]] for field, switch in switches.items()}
    return cast("Any", assumptions)(**meanings)


def settings_of(switches: Sequence[OpenPoint], stated: Mapping[str, str]) -> dict[str, str]:
    """Return the setting of every switch: the one given, else its default.

    Raises:
        UnknownName: a switch or setting that is not there.
    """
    by_name = {switch.name: switch for switch in switches}
    for name, setting in stated.items():
        if name not in by_name:
            raise UnknownName("switch", name, by_name)
        if setting not in by_name[name].settings:
            raise UnknownName(f"setting of {name}", setting, by_name[name].settings)
    return {name: stated.get(name, switch.default) for name, switch in by_name.items()}


def settings_to_prove(switches: Sequence[OpenPoint], stated: Mapping[str, str] | None = None) -> list[dict[str, str]]:
    """Return the settings under which words are proven, the defaults (and what is known) first.

    Every combination where there are few of them; otherwise each switch on its own. What shows in manual alone stays.
    A choice is as chosen; each of these settings is proven with its default, too.

    Raises:
        UnknownName: what is known is no switch or setting.
    """
    default = settings_of(switches, stated or {})
    open_ = [switch for switch in switches if not switch.in_manual and (
        default[switch.name] != switch.default if switch.chosen else switch.name not in (stated or {}))]
    untold = {switch.name: [each for each in switch.settings if each not in switch.summary] for switch in open_}
    varied: Iterable[dict[str, str]]
    if math.prod(map(len, untold.values())) <= _ALL_TOGETHER:
        varied = (default | dict(zip(untold, chosen, strict=True)) for chosen in product(*untold.values()))
    else:
        varied = (default | {name: setting} for name, settings in untold.items() for setting in settings)
    return [default, *(setting for setting in varied if setting != default)]
