"""A PLCopen project (Technical Committee 6, XML formats, 2.01) → program organization units, and its task."""

from __future__ import annotations

import re
from collections.abc import Iterator
from functools import lru_cache
from typing import Final, NamedTuple
from xml.etree import ElementTree as Xml

from heatertune.errors import InputError
from heatertune.plc.cpu.iec.text import ProgramUnit, Variable, body_of, literal

__all__ = ["Project", "project_of"]

_NAMES: Final = {"plc": "http://www.plcopen.org/xml/tc6_0201", "text": "http://www.w3.org/1999/xhtml"}
_KINDS: Final = {"functionBlock": "FUNCTION_BLOCK", "program": "PROGRAM"}
_SECTIONS: Final = {"inputVars": "VAR_INPUT", "outputVars": "VAR_OUTPUT", "localVars": "VAR"}


class Project(NamedTuple):
    """What a project holds.

    Attributes:
        units: function blocks and programs.
        interval_ms: of its only task [ms].
        calls: name of the program that the task calls, in capitals.
    """

    units: list[ProgramUnit]
    interval_ms: int
    calls: str


@lru_cache(4)  # as in `text`
def project_of(text: str) -> Project:
    """Return a project's content.

    Raises:
        InputError: it is none, or holds what is not known here.
    """
    try:
        root = Xml.fromstring(text)
    except Xml.ParseError as problem:
        raise InputError(f"this is no XML: {problem}") from None
    (task,) = _some(root, "task")
    interval = re.fullmatch(r"T#(\d+)ms", task.get("interval", ""))
    called = task.find("plc:pouInstance", _NAMES)
    if interval is None or called is None:
        raise InputError("its task has no interval in ms, or calls nothing")
    units = [_unit(pou) for pou in _some(root, "pou", 2)]
    return Project(units, int(interval[1]), called.get("typeName", "").upper())


def _some(root: Xml.Element, name: str, count: int = 1) -> list[Xml.Element]:
    found = list(root.iter(f"{{{_NAMES['plc']}}}{name}"))
    if len(found) != count:
        raise InputError(f"{len(found)} elements {name}; expected {count}")
    return found


def _unit(pou: Xml.Element) -> ProgramUnit:
    name, kind = pou.get("name", ""), _KINDS.get(pou.get("pouType", ""), "")
    body = pou.findtext("plc:body/plc:ST/text:p", "", _NAMES)
    try:
        return ProgramUnit(kind, name.upper(), tuple(_variables(pou)), body_of(body), tuple(body.splitlines()))
    except InputError as problem:
        raise InputError(f"{name}: {problem}") from None


def _variables(pou: Xml.Element) -> Iterator[Variable]:
    for section in pou.iterfind("plc:interface/*", _NAMES):
        kind = _SECTIONS.get(section.tag.rpartition("}")[2], "")
        constant = " CONSTANT" if section.get("constant") == "true" else ""
        for variable in section.iterfind("plc:variable", _NAMES):
            value = variable.find("plc:initialValue/plc:simpleValue", _NAMES)
            initial = None if value is None else literal(value.get("value", ""))
            yield Variable(f"{kind}{constant}", variable.get("name", "").upper(), _type(variable), initial)


def _type(variable: Xml.Element) -> str:
    type_ = variable.find("plc:type/*", _NAMES)
    if type_ is None:
        raise InputError(f"{variable.get('name')} has no type")
    return (type_.get("name") or type_.tag.rpartition("}")[2]).upper()
