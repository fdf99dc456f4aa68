"""What was read from a machine: a dump of its memory, or text that a programming tool saved or printed → words."""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from pathlib import Path
from typing import Final, NamedTuple

from heatertune.errors import InputError, OutOfRange
from heatertune.pid.design_values import PidDesign
from heatertune.plc.controller import Controller
from heatertune.plc.inputs import has_ends
from heatertune.plc.open_points import settings_of
from heatertune.plc.readback import lines_of, text_of, wrong
from heatertune.plc.words import Scaling, Words, check_fields
from heatertune.writing import read_bytes

__all__ = ["Machine", "content_of", "gain_depends_on_range", "read_machine", "realised_design"]

#: a file so named is no text, whatever it holds
_BINARY: Final = ".bin"
#: of a text and of a line of it: far more than any tool prints of one controller
_LONGEST_TEXT: Final = 1 << 20
_LONGEST_LINE: Final = 1000


class Machine(NamedTuple):
    """What was read of a machine.

    Attributes:
        words: without a ramp, which is a part of the program.
        passed_over, unlike, assumed: as in `ReadBack`.
    """

    words: Words
    passed_over: tuple[str, ...] = ()
    unlike: Callable[[Words], tuple[str, ...]] | None = None
    assumed: tuple[str, ...] = ()


def content_of(path: str | Path) -> bytes:
    """Return the content of a dump or text.

    Raises:
        InputError: it cannot be read.
    """
    try:
        return read_bytes(path)
    except OSError as problem:
        raise InputError(f"{path}: cannot be read: {problem.strerror}") from problem


def read_machine(
    controller: Controller, content: bytes, *, sample_time_s: float | None, scaling: Scaling, source: str,
    stated: Mapping[str, str] | None = None,
) -> Machine:
    """Return the words in a file, and what stands there besides.

    Args:
        controller: what they are of.
        content: of the file, a dump or a text.
        sample_time_s: interval at which the controller is called [s]; None: as its words tell it.
        scaling: sensor range; no memory holds it.
        source: the file's name, for error messages.
        stated: settings of open points; of a text with several heaters they select one.

    Raises:
        InputError: bytes or text that hold no words of this controller, each bad line by its number and value; a
            controller whose words cannot be read back so; an interval that is needed.
        OutOfRange: a word outside its field's range.
        UnknownName: an open point or setting that the controller does not have.
    """
    text = None if source.lower().endswith(_BINARY) else _text(content, source)
    if text is None or controller.text is None:
        if controller.image is None:
            expected = "" if controller.text is None else "; expected text, as its programming tool saves it"
            raise InputError(f"{source}: a dump of {controller.name} cannot be decoded{expected}")
        interval = _interval(controller, sample_time_s)
        words = controller.read_image(content, sample_time_s=interval, scaling=scaling, source=source)
        return Machine(words, assumed=_premises(controller, words))
    settings = settings_of(controller.switches, stated or {})
    read = (controller.text(text, sample_time_s, source) if controller.text_of_heater is None else
            controller.text_of_heater(text, sample_time_s, source, settings["heater"]))
    by_words = None if controller.interval_s is None else controller.interval_s(read.values)
    interval = sample_time_s or by_words or _interval(controller, None)
    words = Words(target=controller.name, values=read.values, scaling=scaling, sample_time_s=interval)
    check_fields(controller.fields, words)
    return Machine(words, read.passed_over, read.unlike, (*read.assumed, *_premises(controller, words)))


def _premises(controller: Controller, words: Words) -> tuple[str, ...]:
    return () if controller.premises is None else controller.premises(words)


def _text(content: bytes, source: str) -> str | None:
    """Return the text in a file, None where there is none; refuse one that is no listing of a controller."""
    text = text_of(content)
    if text is None:
        return None
    if not re.search(r"^(?!>[^>]|[> \t\r]*$)", text, re.MULTILINE):  # quoted in a forum
        text = re.sub(r"^> ?", "", text, flags=re.MULTILINE)
    if len(text) > _LONGEST_TEXT:
        raise InputError(f"{source}: {len(text)} characters; expected one controller's, up to {_LONGEST_TEXT}")
    for number, line in lines_of(text):
        if len(line) > _LONGEST_LINE:
            raise wrong(source, number, "length", str(len(line)), f"a line of up to {_LONGEST_LINE} characters")
    return text


def _interval(controller: Controller, sample_time_s: float | None) -> float:
    if sample_time_s is None and controller.timer.shortest_s == controller.timer.longest_s:
        return controller.timer.shortest_s
    if sample_time_s is None:
        raise InputError(f"--called-every is needed: no parameter of {controller.name} contains its call interval")
    return sample_time_s


def gain_depends_on_range(controller: Controller, words: Words) -> bool:
    """Return whether the words make another gain with another range of the sensor, which no memory holds."""
    s = words.scaling
    if has_ends(controller.ranges, s.input):  # then the module's range is the sensor's
        return False
    wider = replace(words, scaling=controller.scaled(s.input, (s.low_degC, s.high_degC + s.span_degC)))
    gains = [None if design is None else design.gain_pct_per_degC
             for design in (realised_design(controller, each) for each in (words, wider))]
    return gains[0] != gains[1]


def realised_design(controller: Controller, words: Words) -> PidDesign | None:
    """Return the design that words of a running machine make, None where they have no standard form.

    What a manual allows under a condition of the process (`Controller.tolerated`) is no reason to refuse them.

    Raises:
        OutOfRange: words that the controller cannot hold.
    """
    if controller.check_consistency is None:
        controller.check(words)
    else:
        check_fields(controller.fields, words)
        controller.check_consistency(words)
    try:
        return controller.design(words)
    except OutOfRange:
        return None
