"""The words in SCL source, a list of tags, or a table for a watch table."""

from __future__ import annotations

import csv
import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from typing import Final, NamedTuple

from heatertune.plc.pid_compact.export import CALL, LOAD, LOOKED_AT, ROLLBACK, assignments, call, load, rollback
from heatertune.plc.pid_compact.words import BlockTags
from heatertune.plc.ramp import Number
from heatertune.plc.readback import (
    PastedNames,
    ReadBack,
    WordCollector,
    first_unlike,
    lines_of,
    put_pasted,
    real_of,
    unread_lines,
    whole_of,
    wrong,
)
from heatertune.plc.single_precision import single
from heatertune.plc.targets import COOLING
from heatertune.plc.words import WordField, Words

__all__ = ["from_text"]

_COMMENT: Final = re.compile(r"\(\*.*?(?:\*\)|\Z)|//[^\r\n]*", re.DOTALL)
_TAG: Final = re.compile(r'(?:"[^"]*"\s*\.|#)?\s*([A-Za-z_]\w*(?:\s*\.\s*\w+)*)')
#: tag := value, tag = value, with its type or not
_ASSIGNED: Final = re.compile(
    r'((?:"[^"]*"\s*\.\s*|#)?[A-Za-z_]\w*(?:\s*\.\s*\w+)*)\s*(?::\s*(?:REAL|BOOL|INT)\s*)?(?::=|=)\s*([^;]*?)\s*;?',
    re.IGNORECASE)
_FUNCTION: Final = re.compile(r'\bFUNCTION\s+"(\w+)"(.*?)\bEND_FUNCTION\b', re.DOTALL | re.IGNORECASE)
_BEGIN: Final = re.compile(r"\bBEGIN\b", re.IGNORECASE)
_STATEMENT: Final = re.compile(r'IF\b.*?\bTHEN\b|END_IF\s*;|"[^"]*"\s*\([^;]*;|[^;]+;', re.DOTALL | re.IGNORECASE)
#: V1's names of the parameters
_OLD: Final = re.compile(r"s(?:Ret|BackUp|Pid_Cmpt|Pid_Calc)\.", re.IGNORECASE)
_NAME: Final = "NAME"
_MODIFY: Final = "MODIFY VALUE"
_IS_OLD: Final = "Retain.CtrlParams…: this name belongs to V1 of the block, which is not supported"
_WHOLE_TAG: Final = re.compile(r"\w+\.\w|IntegralResetMode$|LoadBackUp$|Disturbance$", re.IGNORECASE)
#: parameters that the block does not compute with, or not to heat
_NOT_ACTIVE: Final = re.compile(r"(?<=CtrlParamsBackUp)(?:\s*\.\s*\w+)+|(?<=\bCool)\s*\.\s*\w+", re.IGNORECASE)
_PARALLEL: Final = re.compile(r"\b(K[id])\b\s*[:=]?\s*\d", re.IGNORECASE)
_OFF_NAMES: Final = re.compile(r"\b(DeadZone|ControlZone|ActivateCooling|InputPerOn)\b[\s:=]+([\w.+-]+)", re.IGNORECASE)
#: what stands before the name of a parameter: the instance, and structures of its data block
_PATH: Final = re.compile(r'(?:"[^"\n]*"\s*\.\s*)?(?:(?:Retain|CtrlParams|Config|Output|Heat|sPid)\s*\.\s*)+',
                          re.IGNORECASE)
#: name on the parameter page, or in other programs → word
_SHOWN: Final = {
    **dict.fromkeys(("proportional gain", "Kp", "Proportionalverstärkung", "Gain proportionnel",
                     "Ganancia proporcional"), "Gain"),
    **dict.fromkeys(("integral action time", "integration time", "integral time", "Tn", "Integrationszeit",
                     "Nachstellzeit", "Temps d'intégration", "Tiempo de integración"), "Ti"),
    **dict.fromkeys(("derivative action time", "derivative time", "Tv", "Differenzierzeit", "Differentiationszeit",
                     "Vorhaltezeit", "Temps de dérivation", "Tiempo derivativo"), "Td"),
    **dict.fromkeys(("derivative delay coefficient", "Koeffizient Differenzierverzug",
                     "Koeffizient Differentiationsverzug"), "TdFiltRatio"),
    **dict.fromkeys(("proportional action weighting", "Gewichtung P-Anteil", "Gewichtung Proportionalanteil"),
                    "PWeighting"),
    **dict.fromkeys(("derivative action weighting", "Gewichtung D-Anteil", "Gewichtung Differentialanteil"),
                    "DWeighting"),
    **dict.fromkeys(("sampling time of PID algorithm", "PID algorithm sampling time", "Abtastzeit PID-Algorithmus",
                     "Abtastzeit des PID-Algorithmus"), "Cycle"),
    "PidUpperLimit": "OutputUpperLimit", "PidLowerLimit": "OutputLowerLimit",
}
_IDLE: Final = {"Td": ("TdFiltRatio", "DWeighting")}
_NEEDED: Final = {"Gain": "Gain = 2.5", "Ti": "Ti = 20 s"}
_TIMES: Final = ("Ti", "Td", "Cycle")
#: what the block starts with; not of Gain and Ti, which somebody who asks about a loop has set
DEFAULTS: Final[Mapping[str, Number]] = {
    "Td": 0.0, "TdFiltRatio": single(0.2), "PWeighting": 1.0, "DWeighting": 1.0, "Cycle": 1.0,
    "OutputUpperLimit": 100.0, "OutputLowerLimit": 0.0, "InvertControl": 0, "IntegralResetMode": 4,
}
#: a zone as wide as this is none
_OFF: Final = 3.4028e38


class _SclAssignments(NamedTuple):
    line: int
    tag: str
    value: str


def from_text(
    tags: BlockTags, fields: Sequence[WordField], text: str, _sample_time_s: float | None, source: str
) -> ReadBack:
    """Return the words in a text, and what it assigns besides.

    Args:
        tags: the block's names.
        fields: its words.
        text: a source, list or table.
        _sample_time_s: not looked at: the words tell it.
        source: name for error messages.

    Raises:
        InputError: a line or cell that is none of a source, list or table; a parameter that is missing, there with two
            values, or out of its range; a zone or cooling that no proof here knows; names of V1 of the block.
    """
    plain = text.replace("\r\n", "\n").replace("\r", "\n")
    collected, others = WordCollector(source, tuple(fields)), list[_SclAssignments]()
    by_tag = {field.address.upper(): field for field in fields}
    off = _switched_off(tags)
    is_list = not _FUNCTION.search(plain) and not any(_is_header(content) for _, content in lines_of(plain))
    if is_list and not tags.cools and not _is_of_tags(plain):
        return _of_thread(fields, off, plain, source)
    for line, tag, value in _all(plain, source):
        field = by_tag.get(tag.upper())
        if field is not None:
            collected.put(field.name, _number(field, value), line, value)
        elif _OLD.match(tag):
            raise wrong(source, line, tag, value, _IS_OLD)
        elif tag.upper() in off:
            least, expectation = off[tag.upper()]
            if not _is(value, least):
                raise wrong(source, line, tag, value, expectation)
        elif is_list and tag.upper().rpartition(".")[2] in {name.rpartition(".")[2] for name in by_tag}:
            raise wrong(source, line, tag, value, f"one of {', '.join(field.address for field in fields)}")
        else:
            others.append(_SclAssignments(line, tag, value))
    over = tuple(f"{tag} := {value} (line {line})" for line, tag, value in others if tag.upper() not in LOOKED_AT)
    assumed = collected.assume(_defaults(fields), _IDLE) if is_list and not tags.cools else ()
    return ReadBack(collected.values(), over, _compared(tags, plain, others), assumed)


def _is_of_tags(text: str) -> bool:
    """Return whether a list assigns to whole tags alone."""
    return all(not content or ((match := _ASSIGNED.fullmatch(content)) and _WHOLE_TAG.match(_tag(match[1])))
               for _, content in lines_of(_blanked(text)))


def _defaults(fields: Sequence[WordField]) -> dict[str, Number]:
    return {field.name: DEFAULTS[field.name] for field in fields if field.name in DEFAULTS}


def _of_thread(
    fields: Sequence[WordField], off: Mapping[str, tuple[str, str]], text: str, source: str,
) -> ReadBack:
    """Return the words in a list as a thread or the parameter page shows it; what it leaves out is the block's default.

    Raises:
        InputError: names of V1, a gain or Ti that is missing, a bad value.
    """
    shown = _PATH.sub("", _NOT_ACTIVE.sub("", _blanked(text)))
    for line, content in lines_of(shown):
        if old := _OLD.search(content):
            raise wrong(source, line, old[0], content[:40], _IS_OLD)
        if parallel := _PARALLEL.search(content):
            raise wrong(source, line, parallel[1], content[:40], "Gain, Ti and Td: Ti is Kp/Ki, Td is Kd/Kp")
        for match in _OFF_NAMES.finditer(content):
            least, expectation = next(rule for tag, rule in off.items() if tag.endswith(f".{match[1].upper()}"))
            if not _is(match[2].rstrip("."), least):
                raise wrong(source, line, match[1], match[2], expectation)
    vocabulary = PastedNames(tuple(fields), _SHOWN, dict.fromkeys(_TIMES, 1.0), frozenset(_TIMES),
                             "PID_Compact or PID_Temp")
    collected = WordCollector(source, tuple(fields))
    put_pasted(collected, shown, vocabulary, _NEEDED, source)
    assumed = collected.assume(_defaults(fields), _IDLE)
    return ReadBack(collected.values(), unread_lines(shown, vocabulary), assumed=assumed)


def _switched_off(tags: BlockTags) -> dict[str, tuple[str, str]]:
    """Return the tags that have to be off, tag → its value, and the message about another value."""
    listed = {
        tags.active("DeadZone"): ("0.0", "0.0: the proof has no dead zone"),
        tags.active("ControlZone"): ("off", "3.402822E38: the proof has no control zone"),
        "Config.ActivateCooling": ("FALSE", "FALSE: the proof of this target has no cooling" + (
            "" if tags.inverts else f"; use target {COOLING['pid-temp']}")),
        "Config.InputPerOn": ("TRUE", "TRUE: the reading is Input_PER"),
    }
    if tags.cools:
        listed |= {
            tags.active("CoolDeadZone"): listed[tags.active("DeadZone")],
            tags.active("CoolControlZone"): listed[tags.active("ControlZone")],
            "Config.ActivateCooling": ("TRUE", "TRUE: without cooling, use target pid-temp"),
        }
    if not tags.inverts:
        listed["Config.InvertControl"] = ("FALSE", "FALSE: PID_Temp is not inverted")
    return {tag.upper(): rule for tag, rule in listed.items()}


def _is(value: str, wanted: str) -> bool:
    if wanted in ("TRUE", "FALSE"):
        return value.upper() in (wanted, {"TRUE": "1", "FALSE": "0"}[wanted])
    number = real_of(value)
    return number is not None and (number >= _OFF if wanted == "off" else number == float(wanted))


def _number(field: WordField, value: str) -> Number | None:
    if field.format == "BOOL":
        return {"TRUE": 1, "FALSE": 0, "1": 1, "0": 0}.get(value.upper())
    return real_of(value) if field.format == "REAL" else whole_of(value)


def _all(text: str, source: str) -> Iterator[_SclAssignments]:
    """Yield what a text assigns to the instance."""
    if _FUNCTION.search(text):
        yield from _of_source(text, source)
    elif any(_is_header(content) for _, content in lines_of(text)):
        yield from _of_table(text, source)
    else:
        yield from _of_list(text, source)


def _of_source(text: str, source: str) -> Iterator[_SclAssignments]:
    """Yield the assignments of the functions in a source, but for what saves the parameters of before."""
    plain = _blanked(text)
    outside = _FUNCTION.sub(lambda match: re.sub(r"[^\n]", " ", match[0]), plain)
    for line, content in lines_of(outside):
        if content:
            raise wrong(source, line, "statement", content, 'FUNCTION "…" to END_FUNCTION')
    for function in _FUNCTION.finditer(plain):
        begins = _BEGIN.search(function[2])
        if begins is None:
            raise wrong(source, plain.count("\n", 0, function.start()) + 1, function[1], "no BEGIN", "BEGIN")
        start = function.start(2) + begins.end()
        for token in _STATEMENT.finditer(plain, start, function.end(2)):
            statement, at = token[0].strip(), token.end() - len(token[0].lstrip())
            line = plain.count("\n", 0, at) + 1
            assigned = _ASSIGNED.fullmatch(statement)
            if assigned is None:
                continue  # compared with what is exported, see `_compared`
            tag, value = _tag(assigned[1]), assigned[2]
            saves = tag.upper().startswith("CTRLPARAMSBACKUP.") or tag.upper() == "LOADBACKUP"
            if not saves:
                yield _SclAssignments(line, tag, value)
        rest = _STATEMENT.sub("", plain[start:function.end(2)]).strip()
        if rest:
            raise wrong(source, plain.count("\n", 0, function.end(2)) + 1, function[1], rest[:40], "a statement and ;")


def _of_table(text: str, source: str) -> Iterator[_SclAssignments]:
    """Yield the rows of a table that have a value to write."""
    delimiter = max(",;\t", key=text.count)
    columns: dict[str, int] = {}
    for line, content in lines_of(text):
        if not content or content.lstrip('"').startswith(("//", "#")):
            continue
        cells = [cell.strip() for cell in next(csv.reader([content], delimiter=delimiter))]
        if _is_header(content):
            columns = {cell.upper(): place for place, cell in enumerate(cells)}
            continue
        if len(cells) < len(columns) or not {_NAME, _MODIFY} <= columns.keys():
            raise wrong(source, line, "row", content, "a row of the watch table below its heads")
        name, value = cells[columns[_NAME]], cells[columns[_MODIFY]]
        match = _TAG.fullmatch(name)
        if match is None:
            raise wrong(source, line, "name", name, '"instance".tag')
        if value and not _tag(name).upper().startswith("CTRLPARAMSBACKUP.") and _tag(name).upper() != "LOADBACKUP":
            yield _SclAssignments(line, _tag(name), value)


def _of_list(text: str, source: str) -> Iterator[_SclAssignments]:
    for line, content in lines_of(_blanked(text)):
        if not content:
            continue
        assigned = _ASSIGNED.fullmatch(content)
        if assigned is None:
            raise wrong(source, line, "parameter", content, "a line such as Retain.CtrlParams.Gain := 2.5;")
        yield _SclAssignments(line, _tag(assigned[1]), assigned[2])


def _is_header(content: str) -> bool:
    upper = content.upper().replace('"', "")
    return upper.startswith(_NAME) and "DISPLAY FORMAT" in upper


def _tag(name: str) -> str:
    """Return a tag without its instance and blanks."""
    match = _TAG.fullmatch(name)
    return re.sub(r"\s", "", match[1] if match else name)


def _blanked(text: str) -> str:
    return _COMMENT.sub(lambda match: re.sub(r"[^\n]", " ", match[0]), text)


def _compared(tags: BlockTags, text: str, others: Sequence[_SclAssignments]) -> Callable[[Words], tuple[str, ...]]:
    """Return what compares the configuration and the source around the words with the exported ones."""
    functions = {match[1]: match for match in _FUNCTION.finditer(_blanked(text))}

    def unlike(words: Words) -> tuple[str, ...]:
        assigned_values = {tag.upper(): value for tag, value, _ in assignments(tags, words, None)}
        for line, tag, value in others:
            own_value = assigned_values.get(tag.upper(), value)
            if value.upper() != own_value and (real_of(value) is None or real_of(value) != real_of(own_value)):
                return (f"{tag} is {value}, not {own_value} (line {line})",)
        own = {LOAD: load(tags, words, None), CALL: call(tags), ROLLBACK: rollback(tags)}
        read = [(text.count("\n", 0, match.start()) + 1, _shape(match[0])) for match in functions.values()]
        ours = [(0, _shape(_blanked(own[name]))) for name in functions if name in own]
        return first_unlike(read, ours)

    return unlike


def _shape(function: str) -> str:
    """Return a function's text without its plain assignments and blanks, its instance by one name."""
    def kept(match: re.Match[str]) -> str:
        assigned = _ASSIGNED.fullmatch(match[0].strip())
        plain = assigned is not None and '"' not in assigned[2] and _tag(assigned[1]).upper() != "LOADBACKUP"
        return "" if plain else match[0]

    head, begin, body = re.split(r"(\bBEGIN\b)", function, maxsplit=1, flags=re.IGNORECASE)
    joined = head + begin + _STATEMENT.sub(kept, body)
    return re.sub(r"\s+", "", re.sub(r'"[^"]*"(?=[.(])', '"PID"', joined)).upper()
