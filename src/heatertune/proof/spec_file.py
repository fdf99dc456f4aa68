"""`spec.toml`: a specification as a file that a person reads, changes and gives back."""

from __future__ import annotations

import math
from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from typing import Final, TypeVar

from heatertune.codec import read_toml
from heatertune.errors import DocumentError, HeatertuneError, UnknownName, one_line
from heatertune.proof.criteria import LIMITS
from heatertune.proof.profile import Profile, profile_of_table, read_profile, table_of
from heatertune.proof.specification import (
    GENERAL,
    NOTHING,
    PRESETS,
    STORY,
    SequencePart,
    Specification,
    limits_from,
    preset,
    split,
)
from heatertune.proof.test_sequence import TestSequence
from heatertune.settings import Conditions

__all__ = ["highest_temperature", "in_force", "read_spec", "spec_text", "specification_of"]

_T = TypeVar("_T")

_TABLES: Final = ("preset", "limits", "story", "profile")


def specification_of(conditions: Conditions) -> Specification:
    """Return the specification in force: options in place of what the preset or file says.

    Raises:
        InputError, UnknownName: as `in_force`.
    """
    own = {"tolerance": conditions.tolerance_degC, "step-power": conditions.step_power_pct}
    units = {"tolerance": "degC", "step-power": "%"}
    flags = [f"{name}={NOTHING if math.isinf(value) else f'{float(value)!r} {units[name]}'}"
             for name, value in own.items() if value is not None]
    return in_force(conditions.spec, [*flags, *conditions.limit], conditions.profile)


def highest_temperature(conditions: Conditions) -> float | None:
    """Return the highest temperature that specification and interlock allow [°C]; None: neither names one.

    Raises:
        InputError, UnknownName: as `in_force`.
    """
    named = (specification_of(conditions).limits_for(1.0).peak_degC, conditions.limit_degC)
    return min((limit for limit in named if limit is not None), default=None)


def in_force(spec: str | None = None, limits: Sequence[str] = (), profile: str | None = None) -> Specification:
    """Return the specification that holds.

    Args:
        spec: name of a preset, or path of a file (it ends in .toml); None: the general one.
        limits: NAME=VALUE, each in place of the specification's own of that name.
        profile: path of a profile's file; None: the specification's own, if it has one.

    Raises:
        UnknownName: no such preset or limit.
        DocumentError: a file that cannot be read as a specification or profile; it names the file and the place in it.
        InputError, OutOfRange: as `limits_from` and `Specification`.
    """
    limits = tuple(limits)
    begun = _of_preset(spec or GENERAL, limits) if spec is None or spec in PRESETS else _limited(_of_file(spec), limits)
    return begun if profile is None else replace(begun, profile=read_profile(profile))


@cache
def _of_preset(name: str, limits: tuple[str, ...]) -> Specification:
    return _limited(preset(name), limits)


def _limited(begun: Specification, limits: Sequence[str]) -> Specification:
    return begun.with_limits(limits_from(limits)) if limits else begun


def _of_file(spec: str) -> Specification:
    if not spec.endswith(".toml"):
        raise UnknownName("specification", spec, [*PRESETS, "a file FILE.toml"])
    return read_spec(spec)


def read_spec(path: str | Path) -> Specification:
    """Return the specification of a file: its preset's limits, those that it names being its own.

    Raises:
        DocumentError: it cannot be read, is no TOML, or a table, key or value is not one of a specification.
    """
    document = read_toml(path)
    for name in document:
        if name not in _TABLES:
            raise DocumentError(f"{path}: {name}: no such table; expected {' or '.join(_TABLES)}")
    base, given, story = document.get("preset", GENERAL), document.get("limits", {}), document.get("story", {})
    for name, value, kind in (("preset", base, str), ("limits", given, dict), ("story", story, dict)):
        if not isinstance(value, kind):
            raise DocumentError(f"{path}: {name}: expected a {'text' if kind is str else 'table'}")
    begun = _at(f"{path}: preset", partial(preset, base))
    own = {name: _at(f"{path}: limits.{name}", partial(_own_limit, begun, name, value))
           for name, value in given.items()}
    parts = {name: _at(f"{path}: story.{name}", partial(_own_part, begun, name, value))
             for name, value in story.items()}
    return Specification(
        name=Path(path).name, limits={**begun.limits, **own}, story={**begun.story, **parts},
        profile=_profile(Path(path), document.get("profile")), base=None if base == GENERAL else base,
        reasons={name: why for name, why in begun.reasons.items() if own.get(name) in (None, begun.limits[name])})


def _at(place: str, read: Callable[[], _T]) -> _T:
    """Return what is read at a place of a file; an error names it."""
    try:
        return read()
    except HeatertuneError as problem:
        raise DocumentError(f"{place}: {problem}") from problem


def _own_limit(begun: Specification, name: str, value: object) -> tuple[str, ...]:
    values = split(name, _texts(value))
    begun.with_limits({name: values})
    return values


def _own_part(begun: Specification, name: str, value: object) -> str:
    setting = _setting(value)
    replace(begun, story={name: setting})
    return setting


def _profile(path: Path, value: object) -> Profile | None:
    """Return the profile of a file beside the specification, or of its own table."""
    if isinstance(value, str):
        return read_profile(path.parent / value)
    if isinstance(value, dict):
        return profile_of_table(path.name, value, f"{path}: profile")
    if value is not None:
        raise DocumentError(f"{path}: profile: expected the name of a file, or a table of lists")
    return None


def _texts(value: object) -> list[str]:
    if isinstance(value, str):
        return [value]
    if isinstance(value, list) and value and all(isinstance(item, str) for item in value):
        return value
    if isinstance(value, int | float) and not isinstance(value, bool):
        return [repr(value)]
    raise DocumentError(f"expected a text such as {'5 %'!r}, or a list of such texts")


def _setting(value: object) -> str:
    if isinstance(value, bool):
        return "on" if value else "off"
    if isinstance(value, str):
        return value
    raise DocumentError("expected true, false or a text such as '10 %'")


def spec_text(spec: Specification) -> str:
    """Return a specification as the text of a file that says the same, with its reasons."""
    return "\n".join([*_lines(spec), ""])


def _lines(spec: Specification) -> Iterator[str]:
    origin = spec.name if spec.name in PRESETS else GENERAL
    yield f"# What words must keep before they leave: the specification {one_line(spec.name)}"
    yield "# Change what you need, then: heatertune design LOG --target NAME --spec FILE.toml"
    yield f"# Several values of one name hold together: [\"5 %\", \"3 degC\"]; \"{NOTHING}\" asks for nothing."
    yield f'preset = "{origin}"  # {PRESETS[origin].description}; what stands below is in its place'
    yield ""
    yield "[limits]"
    for name, kind in LIMITS.items():
        values = spec.limits.get(name, ())
        units = " or ".join(unit for unit in kind.units if unit)
        yield f"# {kind.description}{f' ({units})' if units else ''}"
        if values:
            why = spec.reasons.get(name, "")
            yield f"{name} = {_value(values)}" + (f"  # {why}" if why else "")
        else:
            dropped = bool(preset(origin).limits.get(name))
            yield f'{name} = "{NOTHING}"' if dropped else f'# {name} = "{kind.example}"'


    yield ""
    yield "[story]"
    for name, part in STORY.items():
        yield f"# {part.description}"
        yield f"{name} = {_told(spec.story_at(None), part)}"
    if spec.profile is not None:
        yield ""
        yield f"[profile]  # {one_line(spec.profile.name)}"
        yield from (f'"{head}" = {cells}' for head, cells in table_of(spec.profile).items())


def _told(story: TestSequence, part: SequencePart) -> str:
    """Return how a part of the story is, as TOML says it."""
    value = getattr(story, part.field)
    return str(value).lower() if isinstance(value, bool) else f'"{value / part.factor:g} {part.unit}"'


def _value(values: Sequence[str]) -> str:
    texts = [f'"{value}"' for value in values]
    return texts[0] if len(texts) == 1 else f"[{', '.join(texts)}]"
