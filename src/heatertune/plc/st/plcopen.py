"""PLCopen projects (Technical Committee 6, XML formats, 2.01): written for an export, and read back to run it.

A project holds the controller's block, a program that calls it, and the task of that program.
"""

from __future__ import annotations

import re
from collections.abc import Iterable, Iterator, Mapping, Sequence
from functools import lru_cache
from typing import Final, NamedTuple
from xml.etree import ElementTree as Xml

from heatertune.errors import InputError
from heatertune.plc.cpu.iec.st_syntax import ProgramUnit, Variable, body_of, literal
from heatertune.plc.cpu.statement_translation import in_ascii
from heatertune.plc.st.program_text import BlockSource

__all__ = ["Project", "project", "project_of"]


_NAMES: Final = {"plc": "http://www.plcopen.org/xml/tc6_0201", "text": "http://www.w3.org/1999/xhtml"}
_KINDS: Final = {"functionBlock": "FUNCTION_BLOCK", "program": "PROGRAM"}
_PROJECT_SECTIONS: Final = {"inputVars": "VAR_INPUT", "outputVars": "VAR_OUTPUT", "localVars": "VAR"}


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
    instance = task.find("plc:pouInstance", _NAMES)
    if interval is None or instance is None:
        raise InputError("its task has no interval in ms, or calls nothing")
    units = [_unit(pou) for pou in _some(root, "pou", 2)]
    return Project(units, int(interval[1]), instance.get("typeName", "").upper())


def _some(root: Xml.Element, name: str, count: int = 1) -> list[Xml.Element]:
    elements = list(root.iter(f"{{{_NAMES['plc']}}}{name}"))
    if len(elements) != count:
        raise InputError(f"{len(elements)} elements {name}; expected {count}")
    return elements


def _unit(pou: Xml.Element) -> ProgramUnit:
    name, kind = pou.get("name", ""), _KINDS.get(pou.get("pouType", ""), "")
    body = pou.findtext("plc:body/plc:ST/text:p", "", _NAMES)
    try:
        return ProgramUnit(kind, name.upper(), tuple(_variables(pou)), body_of(body), tuple(body.splitlines()))
    except InputError as problem:
        raise InputError(f"{name}: {problem}") from None


def _variables(pou: Xml.Element) -> Iterator[Variable]:
    for section in pou.iterfind("plc:interface/*", _NAMES):
        kind = _PROJECT_SECTIONS.get(section.tag.rpartition("}")[2], "")
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


ProgramVariable = tuple[str, str, str, str]

_NAMESPACE: Final = "http://www.plcopen.org/xml/tc6_0201"
_XHTML: Final = "http://www.w3.org/1999/xhtml"
#: the format demands an instant; exports carry no date, so it is always this one
_INSTANT: Final = "2000-01-01T00:00:00"

_SECTIONS: Final = {
    "VAR_INPUT": "inputVars", "VAR_OUTPUT": "outputVars", "VAR": "localVars", "VAR CONSTANT": "localVars",
}
#: every start-up is from cold, as proven
_KEPT: Final = {"VAR": {"nonretain": "true"}, "VAR CONSTANT": {"constant": "true"}}


def project(
    block: BlockSource, variables: Sequence[ProgramVariable], statements: str, head: Iterable[str], interval_ms: int
) -> str:
    """Return the project's XML.

    Args:
        block: that the program calls.
        variables: name, type, initial value and meaning of the program's variables.
        statements: of the program.
        head: lines for the description of the project.
        interval_ms: of the task [ms].
    """
    root = Xml.Element("project", {"xmlns": _NAMESPACE})
    Xml.SubElement(root, "fileHeader", {
        "companyName": "heatertune", "productName": "heatertune", "productVersion": "1", "creationDateTime": _INSTANT,
    })
    _content_header(root, head)
    types = Xml.SubElement(root, "types")
    Xml.SubElement(types, "dataTypes")
    pous = Xml.SubElement(types, "pous")
    _pou(pous, block.name, "functionBlock", block.declarations, "", block.body)
    _pou(pous, "Heater", "program", {"VAR": variables}, block.name, statements)
    _instances(root, interval_ms)
    Xml.indent(root)
    return '<?xml version="1.0" encoding="utf-8"?>\n' + Xml.tostring(root, encoding="unicode") + "\n"


def _content_header(root: Xml.Element, head: Iterable[str]) -> None:
    header = Xml.SubElement(root, "contentHeader", {"name": "heater controller"})
    Xml.SubElement(header, "Comment").text = in_ascii("\n".join(head))
    information = Xml.SubElement(header, "coordinateInfo")
    for language in ("fbd", "ld", "sfc"):
        Xml.SubElement(Xml.SubElement(information, language), "scaling", {"x": "1", "y": "1"})


def _pou(
    pous: Xml.Element, name: str, kind: str, sections: Mapping[str, Sequence[ProgramVariable]],
    instance_of: str, statements: str,
) -> None:
    pou = Xml.SubElement(pous, "pou", {"name": name, "pouType": kind})
    interface = Xml.SubElement(pou, "interface")
    for section, variables in sections.items():
        listed = Xml.SubElement(interface, _SECTIONS[section], _KEPT.get(section, {}))
        for variable in variables:
            _variable(listed, *variable)
        if instance_of:
            one = Xml.SubElement(Xml.SubElement(listed, "variable", {"name": "HeaterPid"}), "type")
            Xml.SubElement(one, "derived", {"name": instance_of})
    text = Xml.SubElement(Xml.SubElement(pou, "body"), "ST")
    Xml.SubElement(text, "p", {"xmlns": _XHTML}).text = statements


def _variable(listed: Xml.Element, name: str, type_: str, initial: str, meaning: str) -> None:
    variable = Xml.SubElement(listed, "variable", {"name": name})
    Xml.SubElement(Xml.SubElement(variable, "type"), type_)
    if initial:
        Xml.SubElement(Xml.SubElement(variable, "initialValue"), "simpleValue", {"value": initial})
    documentation = Xml.SubElement(variable, "documentation")
    Xml.SubElement(documentation, "p", {"xmlns": _XHTML}).text = meaning


def _instances(root: Xml.Element, interval_ms: int) -> None:
    configurations = Xml.SubElement(Xml.SubElement(root, "instances"), "configurations")
    configuration = Xml.SubElement(configurations, "configuration", {"name": "HeaterConfiguration"})
    resource = Xml.SubElement(configuration, "resource", {"name": "HeaterResource"})
    task = Xml.SubElement(resource, "task", {"name": "HeaterTask", "priority": "0", "interval": f"T#{interval_ms}ms"})
    Xml.SubElement(task, "pouInstance", {"name": "HeaterProgram", "typeName": "Heater"})
