"""What a controller's manual leaves open, declared once: as fields of the named tuple that its step takes.

    class Assumptions(NamedTuple):
        truncates: Annotated[bool, Switch(
            name="conversion", means={"rnd": False, "trunc": True}, why="whether OUT is rounded or cut",
        )] = False

From it come the switches that users see, the settings that a proof runs, the table in DIFFERENCES.md, and the value
that the step reads. Nothing goes by position: fields may stand in any order.
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
    """Return True: a run may show how the switch is set, whatever the words."""
    return True


def never(_parameters: Any) -> bool:
    """Return False: no run shows how the switch is set, as none takes the controller where it counts."""
    return False


@dataclass(frozen=True, slots=True, kw_only=True)
class OpenPoint:
    """A point the manual leaves open.

    Attributes:
        name: on the command line.
        means: each setting → what the field then holds; the default first.
        why: what is open, as in the table of DIFFERENCES.md.
        in_manual: whether it shows where the mode of the controller changes alone: no run of a proof does that.
        told: settings that a program follows which is told of them; they are proven where the user says them alone.
        chosen: whether the user chooses it, and the export does as chosen: the proof runs the setting chosen and the
            default, which a PLC that forgets falls back to.
        shows: what the step takes first → whether a run may show how it is set; where it cannot, every setting gives
            the same, bit for bit, and one of them is run for all.
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
        """The setting of a controller about which nothing more is known."""
        return self.settings[0]


class NothingOpen(NamedTuple):
    """What a step assumes whose manual leaves nothing open."""


@cache
def open_points_of(assumptions: type[NamedTuple]) -> Mapping[str, OpenPoint]:
    """Return the switch of each field of a named tuple, in the order of the fields.

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


def assumptions_from(assumptions: type[NamedTuple], given: Mapping[str, str]) -> Any:
    """Return the named tuple for settings of its switches; those not given have their default.

    Raises:
        UnknownName: a switch or setting that is not there.
    """
    switches = open_points_of(assumptions)
    settings = settings_of(tuple(switches.values()), given)
    meanings = {field: switch.means[settings[switch.name]] for field, switch in switches.items()}
    return cast("Any", assumptions)(**meanings)


def settings_of(switches: Sequence[OpenPoint], given: Mapping[str, str]) -> dict[str, str]:
    """Return the setting of every switch: the one given, else its default.

    Raises:
        UnknownName: a switch or setting that is not there.
    """
    by_name = {switch.name: switch for switch in switches}
    for name, setting in given.items():
        if name not in by_name:
            raise UnknownName("switch", name, by_name)
        if setting not in by_name[name].settings:
            raise UnknownName(f"setting of {name}", setting, by_name[name].settings)
    return {name: given.get(name, switch.default) for name, switch in by_name.items()}


def settings_to_prove(switches: Sequence[OpenPoint], known: Mapping[str, str] | None = None) -> list[dict[str, str]]:
    """Return the settings under which words are proven, the defaults (and what is known) first.

    Every combination where there are few of them; otherwise each switch on its own. What shows in manual alone stays.
    A choice is as chosen; each of these settings is proven with its default, too.

    Raises:
        UnknownName: what is known is no switch or setting.
    """
    default = settings_of(switches, known or {})
    open_ = [switch for switch in switches if not switch.in_manual and (
        default[switch.name] != switch.default if switch.chosen else switch.name not in (known or {}))]
    untold = {switch.name: [each for each in switch.settings if each not in switch.summary] for switch in open_}
    varied: Iterable[dict[str, str]]
    if math.prod(map(len, untold.values())) <= _ALL_TOGETHER:
        varied = (default | dict(zip(untold, chosen, strict=True)) for chosen in product(*untold.values()))
    else:
        varied = (default | {name: setting} for name, settings in untold.items() for setting in settings)
    return [default, *(setting for setting in varied if setting != default)]
