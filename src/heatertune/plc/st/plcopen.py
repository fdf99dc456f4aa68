"""The block, a program that calls it, and its task as a PLCopen project (Technical Committee 6, XML formats, 2.01)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping, Sequence
from typing import Final
from xml.etree import ElementTree as Xml

from heatertune.plc.cpu.statements import in_ascii
from heatertune.plc.st.program import BlockSource

__all__ = ["project"]

Variable = tuple[str, str, str, str]

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
    block: BlockSource, variables: Sequence[Variable], statements: str, head: Iterable[str], interval_ms: int
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
    pous: Xml.Element, name: str, kind: str, sections: Mapping[str, Sequence[Variable]],
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
