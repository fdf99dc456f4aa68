"""An option is one field: name, unit, range, default, help, flag and what it needs are declared where its value is.

A frozen dataclass of options refuses what is out of range when it is made (`checked`); the command line, the keys of
a study and the rows of a record are read from the same declaration (`options_of`).
"""

from __future__ import annotations

import functools
import inspect
import os
import re
import textwrap
from argparse import Namespace
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, field, fields, replace
from numbers import Integral, Real
from typing import Any, Final, TypeVar

from heatertune.codec import LEFT_OUT
from heatertune.errors import InputError, OutOfRange, UnknownName, demand_known, did_you_mean
from heatertune.units import check

__all__ = ["Keywords", "Option", "add", "checked_arguments", "merge_options", "of", "one_of", "option", "options_of",
           "point_of", "provided_options", "split_options", "validate_options", "with_options"]

_T = TypeVar("_T")
#: of a function, by name
Keywords = Mapping[str, Any]
_Verb = TypeVar("_Verb", bound=Callable[..., Any])
_THOUSAND: Final = 3  # digits after a comma that may separate thousands
_METAVARS: Final = {"s": "S"}
_KINDS: Final[Mapping[type, tuple[type, str]]] = {
    tuple: (tuple, "a text, or a list of texts"), dict: (Mapping, "a dictionary, name to setting"),
    str: (str, "a text")}
_OPTIONS: Final[dict[type, dict[str, Option]]] = {}
_BY_NAME: Final = "give options by name, {verb}(..., name=value)"
#: class of an argument → how to get one; of other classes nothing is checked
_WAYS: Final[Mapping[str, str]] = {
    "Log": "read_log(path) reads one", "FittedModel": "fit(log) finds one, model_by_hand(heater) makes one",
    "HeaterModel": "", "PidDesign": "tune(model, target=...) finds one",
    "Words": "encode(design, target, model) makes them", "Proof": "prove(words, model) makes one",
    "DesignRequest": "give options by name, design(log, target=...)", "Scaling": "or give range_degC=(low, high)",
    "str": "", "Path": "", "None": "",
} | dict.fromkeys(("TuneSettings", "FitSettings", "ReadSettings", "ValidateSettings", "Conditions"), _BY_NAME)
_MEMBERS: Final[Mapping[str, set[str]]] = {
    "HeaterModel": {"Fopdt", "TwoLag"}, "None": {"NoneType"}, "Path": {"PurePath"}}


@dataclass(frozen=True, slots=True, kw_only=True)
class Option:
    """What is known of one option.

    Attributes:
        name: of the field, with its unit at the end.
        kind: float, int, str, bool, tuple (texts, one for each time it is given) or dict (name → setting).
        default: where nothing is said.
        what: its meaning, a few words.
        unit: of its value.
        help: on the command line, where that is more than `what` and unit.
        instead: what is taken where nothing is said, as the help and as the record say it; empty: they do not.
        label: in the record, where that is not `what`.
        flag: on the command line; empty: it has none.
        dest: of the flag.
        metavar: of the flag; empty: the unit's.
        choices: texts it may be.
        automatic: texts on the command line that leave a number to the program.
        or_text: texts that may stand in place of a number.
        several: whether the flag takes one number or more.
        pair: how the two numbers are called that the value is; empty: it is no pair.
        above, least, most, infinite: range of a number, as `heatertune.units.check` takes it.
        or_zero: whether 0 may be below `least`.
        needs: name of the option without which it means nothing.
    """

    name: str = ""
    kind: type
    default: Any
    quantity: str
    unit: str = ""
    help: str = ""
    instead: tuple[str, str] = ("", "")
    label: str = ""
    flag: str = ""
    dest: str = ""
    metavar: str = ""
    choices: Sequence[str] = ()
    automatic: Sequence[str] = ()
    or_text: Sequence[str] = ()
    several: bool = False
    pair: tuple[str, ...] = ()
    above: float | None = None
    least: float | None = None
    most: float | None = None
    infinite: bool = False
    or_zero: bool = False
    needs: str = ""

    def check(self, value: Any, called: str) -> None:
        """Refuse a value that the option cannot have; `called` is how the user calls it.

        Raises:
            OutOfRange: a number out of range, or none.
            UnknownName: a text that is not one of the choices.
        """
        if value is None and self.default is None:
            return
        if self.choices and value not in self.choices:
            raise UnknownName(called.replace("_", " "), str(value), self.choices)
        of_kind, rule = _KINDS.get(self.kind, (object, ""))
        if not isinstance(value, of_kind) and not ("column" in self.name and isinstance(value, int)):
            raise OutOfRange(called, value, rule)
        if self.pair and not (isinstance(value, tuple) and len(value) == len(self.pair)):
            raise OutOfRange(called, value, "two numbers")
        if self.kind in (float, int) and not (isinstance(value, str) and value in self.or_text):
            for number in value if (self.several or self.pair) and isinstance(value, tuple) else (value,):
                self._check_number(number, called)

    def spelled(self, value: Any) -> Any:
        """Return a value of Python as the command line would hold it: "PI" is pi, "auto" no number, a list a tuple."""
        if isinstance(value, str | os.PathLike):
            return self._spelled_text(os.fspath(value))
        several = self.kind is tuple or ((self.pair or self.several) and isinstance(value, list) and len(value) > 1)
        return tuple(value) if several and isinstance(value, list) else value

    def _spelled_text(self, text: str) -> Any:
        if text in self.automatic[:1]:
            return None
        return (text,) if self.kind is tuple else one_of((*self.choices, *self.or_text))(text)

    def plain(self, value: Any) -> Any:
        """Return a checked value with whole numbers as a `float` where it is one, and NumPy's as Python's own.

        Compiled loops take each type of a number for another program, or for none.
        """
        if isinstance(value, tuple):
            return tuple(map(self.plain, value))
        if self.kind is float and isinstance(value, Real):
            return float(value)
        return int(value) if self.kind is int and isinstance(value, Integral) else value

    def _check_number(self, value: Any, called: str) -> None:
        if not isinstance(value, Integral if self.kind is int else Real):
            raise OutOfRange(called, value, "a whole number" if self.kind is int else "a number")
        if self.or_zero and value == 0.0:
            return
        try:
            check(called, float(value), above=self.above, least=self.least, most=self.most, infinite=self.infinite)
        except OutOfRange as problem:
            raise OutOfRange(called, value, ("0, or " if self.or_zero else "") + problem.rule) from None
        except OverflowError:  # a whole number of hundreds of digits
            raise OutOfRange(called, value, "a finite number") from None

    @property
    def quantity_with_unit(self) -> str:
        """What it is, with its unit."""
        return f"{self.quantity} [{self.unit}]" if self.unit else self.quantity

    @property
    def given_by(self) -> str:
        """Where its value comes from, as the record says it."""
        return f"{self.flag}, else {self.instead[1]}" if self.instead[1] else self.flag

    @property
    def arguments(self) -> dict[str, Any]:
        """What `add_argument` is told."""
        default = f" (default: {self.instead[0]})" if self.instead[0] else ""
        help_ = f"{self.help or self.quantity_with_unit}{default}".replace("%", "%%")
        keywords: dict[str, Any] = {"dest": self.dest, "help": help_}
        if self.kind is bool:
            return keywords | {"action": "store_true"}
        keywords |= {"default": self.automatic[0] if self.automatic else self.default}
        if self.choices:
            return keywords | {"choices": tuple(self.choices), "type": one_of(self.choices)}
        keywords["metavar"] = self.metavar or _METAVARS.get(self.unit, self.unit) or None
        if self.kind in (tuple, dict):
            return keywords | {"action": "append", "default": []}
        keywords |= {"nargs": "+"} if self.several else {"nargs": 2, "metavar": self.pair} if self.pair else {}
        return keywords | ({} if self._texts or self.kind is str else {"type": self.kind})

    def read(self, value: Any) -> Any:
        """Return the value of what the command line holds.

        Raises:
            OutOfRange, UnknownName: as `check`.
            InputError: no value of this kind, or too many.
        """
        if self.kind is dict:
            value = _pairs(self.flag, value)
        elif self.kind is tuple or self.pair:
            value = None if value is None else tuple(value)
        elif self.several and value is not None:
            if len(value) > 2:
                raise InputError(f"{self.flag} has {len(value)} values; expected one, or LOW HIGH")
            value = value[0] if len(value) == 1 else tuple(value)
        elif self._texts:
            value = self._number(value)
        self.check(value, self.flag)
        return value

    @property
    def _texts(self) -> Sequence[str]:
        return (*self.automatic, *self.or_text)

    def _number(self, text: str | None) -> float | str | None:
        if text is None or text in self.automatic:
            return None
        try:
            return text if text in self.or_text else float(point_of(text))
        except ValueError as problem:
            *first, last = self._texts
            expected = ", ".join(["seconds" if self.unit == "s" else self.unit, *first])
            meant = did_you_mean(text, self._texts).removeprefix(": ")
            near = f"; {meant}" if meant else ""
            raise InputError(f"{self.flag} is {text!r}{near}; expected {expected} or {last}") from problem


def point_of(text: str) -> str:
    """Return a number with a decimal comma, "53,3", with a point; 1,000 may be a thousand, and stays as it is."""
    whole, comma, rest = text.partition(",")
    plain = whole.lstrip("+-").isdecimal() and rest.isdecimal() and len(rest) != _THOUSAND
    return f"{whole}.{rest}" if comma and plain else text


def one_of(choices: Iterable[str]) -> Callable[[str], str]:
    """Return what reads one of some names: as it is spelled, whatever the case it is typed in."""
    names = {name.lower(): name for name in choices}
    return lambda typed: names.get(typed.lower(), typed)


def option(default: Any, kind: type, what: str, *, left_out: bool = False, **more: Any) -> Any:
    """Return the field of a dataclass that is an option.

    Args:
        default: as of `Option`.
        kind: likewise.
        what: likewise.
        left_out: whether a document leaves it out where it is None, see `heatertune.codec.LEFT_OUT`.
        more: further attributes of `Option`.
    """
    metadata = {"option": Option(kind=kind, default=default, quantity=what, **more), **(LEFT_OUT if left_out else {})}
    return field(default_factory=dict, metadata=metadata) if kind is dict else field(default=default, metadata=metadata)


def options_of(kind: type) -> dict[str, Option]:
    """Return the options of a dataclass, by the names of their fields; it may have other fields, too."""
    if kind not in _OPTIONS:
        declared = {one.name: one.metadata["option"] for one in fields(kind) if "option" in one.metadata}
        _OPTIONS[kind] = {
            name: replace(one, name=name, dest=one.dest or one.flag.strip("-").replace("-", "_"))
            for name, one in declared.items()}
    return _OPTIONS[kind]


def validate_options(settings: Any) -> None:
    """Refuse what a dataclass of options cannot hold, and make its numbers plain; its `__post_init__` calls this.

    Raises:
        OutOfRange, UnknownName: as `Option.check`.
        InputError: an option without the one it needs.
    """
    options = options_of(type(settings))
    for name, one in options.items():
        value = one.spelled(getattr(settings, name))
        one.check(value, name)
        object.__setattr__(settings, name, one.plain(value))
    _demand_needed(options, {name: getattr(settings, name) for name in options}, "name")


def _demand_needed(options: Mapping[str, Option], values: Mapping[str, Any], called: str) -> None:
    for needed in dict.fromkeys(one.needs for one in options.values() if one.needs):
        needing = [one for one in options.values() if one.needs == needed]
        if values[needed] is None and any(values[one.name] != one.default for one in needing):
            names = [getattr(one, called) for one in needing]
            listed = " and ".join(filter(None, (", ".join(names[:-1]), names[-1])))
            raise InputError(f"{listed} need {getattr(options[needed], called)}")


def merge_options(kind: type[_T], settings: _T | None, changed: Keywords, *, also: Iterable[str] = ()) -> _T:
    """Return settings (None: the defaults) with some of them changed.

    Args:
        kind: the dataclass of options.
        settings: None: the defaults.
        changed: field → value.
        also: other keywords of the function that was called, for the suggestion in an error.

    Raises:
        UnknownOption: no such field.
        InputError: as `validate_options`.
    """
    _demand_options(changed, kind, also=also)
    base: Any = kind() if settings is None else settings
    return kind(**{name: getattr(base, name) for name in options_of(kind)} | dict(changed))


def _demand_options(keywords: Iterable[str], *kinds: type, also: Iterable[str] = ()) -> None:
    """Refuse keywords that no dataclass of options has.

    Args:
        keywords: their names.
        kinds: the dataclasses.
        also: other keywords of the function that was called.

    Raises:
        UnknownOption: the first of them; its text names the closest option, also by its flag's name.
    """
    destinations = {name: one.dest for kind in kinds for name, one in options_of(kind).items()}
    demand_known([name for name in keywords if name not in destinations], [*destinations, *also],
                 {dest: name for name, dest in reversed(destinations.items())})


def split_options(keywords: Keywords, *kinds: type, also: Iterable[str] = ()) -> list[Keywords]:
    """Return the keywords of each dataclass of options; UnknownOption as `merge_options`."""
    _demand_options(keywords, *kinds, also=also)
    return [{name: value for name, value in keywords.items() if name in options_of(kind)} for kind in kinds]


def with_options(*kinds: type, own: Keywords | None = None) -> Callable[[_Verb], _Verb]:
    """Return a decorator that lists options in the signature and the help of a function with `**changed`.

    An editor and mypy read them from `heatertune.keywords`; `help` and notebooks read what is set here. Arguments are
    checked as by `checked_arguments`; to an error that names a flag, a note adds the option's name in Python.

    Args:
        kinds: the dataclasses of options.
        own: further keywords → default.
    """
    def decorate(verb: _Verb) -> _Verb:
        signature = inspect.signature(verb)
        parameters = [each for each in signature.parameters.values() if each.kind is not inspect.Parameter.VAR_KEYWORD]
        options = {name: one for kind in kinds for name, one in options_of(kind).items()
                   if name not in signature.parameters}
        defaults = {**(own or {}), **{name: one.default for name, one in options.items()}}
        keywords = [inspect.Parameter(name, inspect.Parameter.KEYWORD_ONLY, default=default)
                    for name, default in defaults.items()]
        lines = "\n".join(_described(one) for one in options.values())
        wrapper = _noted(checked_arguments(verb), options)
        wrapper.__doc__ = f"{inspect.getdoc(verb)}\n\nOptions:\n{lines}"
        wrapper.__signature__ = signature.replace(parameters=[*parameters, *keywords])  # type: ignore[attr-defined]  # inspect reads it
        return wrapper

    return decorate


def _noted(verb: _Verb, options: Mapping[str, Option]) -> _Verb:
    """Return a function whose errors have a note of the names of options in Python, from their flags."""
    names = {one.flag: name for name, one in options.items()}

    @functools.wraps(verb)
    def called(*arguments: Any, **keywords: Any) -> Any:
        try:
            return verb(*arguments, **keywords)
        except InputError as problem:
            flags = dict.fromkeys(re.findall(r"--[a-z][a-z-]*", str(problem)))
            note = "; ".join(f"{flag} is {names[flag]} in Python" for flag in flags if flag in names)
            if note and note not in getattr(problem, "__notes__", ()):
                problem.add_note(note)
            raise

    return called  # type: ignore[return-value]  # of the same signature


def checked_arguments(verb: _Verb) -> _Verb:
    """Return a function that refuses a value of another stage in place of the one that an argument has to be.

    Its annotations say what each argument may be; one of a class that `_WAYS` does not know is not checked.

    Raises:
        InputError: such a value; the error names the function that makes the right one.
    """
    annotations = {name: str(kinds).split(" | ") for name, kinds in verb.__annotations__.items() if name != "return"}
    allowed = {name: kinds for name, kinds in annotations.items() if set(kinds) <= _WAYS.keys()}
    names = list(inspect.signature(verb).parameters)

    @functools.wraps(verb)
    def called(*arguments: Any, **keywords: Any) -> Any:
        for name, value in (*zip(names, arguments, strict=False), *keywords.items()):
            if name in allowed and not _is_of(value, allowed[name]):
                raise InputError(_refusal(verb.__name__, name, value, allowed[name]))
        return verb(*arguments, **keywords)

    return called  # type: ignore[return-value]  # of the same signature


def _refusal(verb: str, name: str, value: object, kinds: Sequence[str]) -> str:
    ways = "; ".join(filter(None, (_WAYS[kind].format(verb=verb) for kind in kinds)))
    if name == "read":  # whose options the function does not have
        ways = "heatertune.ReadSettings(name=value) is one"
    got = repr(value) if isinstance(value, str | None) else f"of type {type(value).__name__}"
    return f"{verb}: {name} is {got}; expected {' or '.join(kinds)}{f': {ways}' if ways else ''}"


def _is_of(value: object, kinds: Iterable[str]) -> bool:
    return not {name for kind in kinds for name in _MEMBERS.get(kind, {kind})}.isdisjoint(
        each.__name__ for each in type(value).__mro__)


def _described(entry: Option) -> str:
    """Return an option as an entry of a docstring: its meaning, unit, choices and default."""
    choices = f": {', '.join(entry.choices)}" if entry.choices else ""
    default = entry.instead[0] or ("" if entry.default in (None, (), {}, False) else f"{entry.default}")
    text = f"{entry.name}: {entry.quantity_with_unit}{choices}{f' (default: {default})' if default else ''}"
    return textwrap.fill(text, 110, initial_indent="    ", subsequent_indent="        ")


def add(group: Any, kind: type, *names: str, but: Sequence[str] = (), **changed: Any) -> None:
    """Add the flags of a dataclass of options to a parser or a group of one.

    Args:
        group: where they are shown.
        kind: the dataclass.
        names: of the fields whose flags are added; none: all.
        but: those left out.
        changed: what `add_argument` is told otherwise here.
    """
    for name, one in options_of(kind).items():
        if one.flag and name not in but and (not names or name in names):
            group.add_argument(one.flag, **one.arguments | changed)


def of(kind: type[_T], namespace: Namespace) -> _T:
    """Return a dataclass of options as the command line has them; flags that a command does not have are not given.

    Raises:
        InputError: as `checked`, in the words of the command line.
    """
    options, values = options_of(kind), provided_options(kind, namespace)
    _demand_needed(options, {name: values.get(name, one.default) for name, one in options.items()}, "flag")
    return kind(**values)


def provided_options(kind: type, namespace: Namespace) -> dict[str, Any]:
    """Return the options that the command line has, by name: all of the command, but those that are left out if unsaid.

    Raises:
        InputError: as `Option.read`.
    """
    return {name: one.read(getattr(namespace, one.dest)) for name, one in options_of(kind).items()
            if hasattr(namespace, one.dest)}


def _pairs(flag: str, arguments: Sequence[str]) -> dict[str, str]:
    pairs = [text.partition("=") for text in arguments]
    for name, equals, _ in pairs:
        if not equals:
            raise InputError(f"{flag} {name!r} has no setting; expected NAME=SETTING")
    return {name: setting for name, _, setting in pairs}
