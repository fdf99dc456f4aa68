"""Marlin's gains in text: Configuration.h, G-code, what M503 prints, and what M303 prints at its end."""

from __future__ import annotations

import re
from typing import Final

from heatertune.errors import InputError
from heatertune.plc.marlin.words import FIELDS, LEAST_LOOPS, LOOP_S, USUAL
from heatertune.plc.readback import Collected, ReadBack, lines_of, real_of, whole_of, wrong

__all__ = ["from_text"]

_NUMBER: Final = r"[-+]?(?:\d+\.?\d*|\.\d+)"
#: what a host program writes before a line of the printer's
_SAID: Final = re.compile(r"^(?:(?:Recv|Send|READ|SENT|>>>|<<<)\s*:?\s*)?(?:echo:\s*)?", re.IGNORECASE)
_DEFINE: Final = re.compile(r"#\s*define\s+(\w+)\s*(.*?)\s*(?://.*|/\*.*)?$")
_GAIN: Final = re.compile(r"M301\b(.*)", re.IGNORECASE)
#: gains of a bed, or of a heater that an export does not know: as comments
_OTHER_GAIN: Final = re.compile(r"(?:M304|[;/][;/\s]*M30[14])\b(.*)", re.IGNORECASE)
_OTHER_DEFINE: Final = re.compile(r"(?:[;/\s]*)#\s*define\s+(DEFAULT_(?:bed)?K[pid]|MAX_BED_POWER)\s+(\S+)")
_LETTER: Final = re.compile(rf"([A-Z])\s*({_NUMBER})?(?=\s|[A-Z]|$)", re.IGNORECASE)
_TUNED: Final = re.compile(rf"(?:\s*K[pid]:\s*{_NUMBER})+\s*")
_ONE_TUNED: Final = re.compile(rf"(K[pid]):\s*({_NUMBER})")
_LOOPS: Final = re.compile(r"ADC_LOOPS\s*=\s*(\S+?):?(?:\s|$)")
_LETTERS: Final = {"P": "Kp", "I": "Ki", "D": "Kd"}
_DEFINED: Final = {f"DEFAULT_{name}": name for name in _LETTERS.values()} | {
    name: name for name in ("PID_MAX", "PID_FUNCTIONAL_RANGE", "PID_K1")}
_OTHERS: Final = re.compile(r"DEFAULT_K[pid]_LIST", re.IGNORECASE)
_WHOLE: Final = frozenset(field.name for field in FIELDS if field.format == "BYTE")
_TWO_DECIMALS: Final = re.compile(r"echo:.*M301", re.IGNORECASE)


def from_text(text: str, sample_time_s: float | None, source: str) -> ReadBack:
    """Return the words in a text; what only the build knows is as usual where the text does not tell it.

    Gains of a bed are read where there are none of a hot end, and those in comments where there are no others.

    Raises:
        InputError: a gain that is missing, there with two values or no number; M301 of a second hot end.
    """
    collected, over = Collected(source, FIELDS), list[str]()
    seen: set[str] = set()
    for line, content in lines_of(text):
        found = _line(content, line, source)
        if found is None:
            if content and not content.startswith((";", "//")):
                over.append(f"{content[:40]} (line {line})")
            continue
        if _TWO_DECIMALS.search(content):
            over.append(f"M503 prints two decimals (line {line}): the firmware's gains may be half a digit off these")
        for name, value in found:
            seen.add(name)
            collected.put(name, (whole_of if name in _WHOLE else real_of)(value), line, value)
    if not seen & set(_LETTERS.values()):
        for name, value, line in _other_gains(text, source):
            seen.add(name)
            collected.put(name, (whole_of if name in _WHOLE else real_of)(value), line, value)
    if not seen & set(_LETTERS.values()):
        raise InputError(f"{source}: no gain of Marlin's; expected #define DEFAULT_Kp, M301 or the lines of M303")
    for name in USUAL.keys() - seen:
        usual = USUAL[name] if name != "ADC_LOOPS" else _loops(sample_time_s)
        collected.put(name, usual, 0, str(usual))
        over.append(f"{name} is not there: {usual:g}, as usual")
    return ReadBack(collected.values(), tuple(sorted(over)))


def _line(content: str, line: int, source: str) -> list[tuple[str, str]] | None:
    """Return the words of a line, None where there are none."""
    plain = _SAID.sub("", content).strip()
    bare = re.sub(r"^[;/\s]+", "", plain)
    if match := _LOOPS.match(bare):
        return [("ADC_LOOPS", match[1])]
    if match := _DEFINE.match(plain if plain.startswith("#") else bare if "PID_" in bare else ""):
        if _OTHERS.fullmatch(match[1]):
            raise wrong(source, line, match[1], match[2], "one hot end: a list has several")
        return [(_DEFINED[match[1]], match[2].strip("() "))] if match[1] in _DEFINED else None
    if match := _GAIN.match(plain):
        return _m301(match[1].partition(";")[0].strip(), line, source)
    return [(name, value) for name, value in _ONE_TUNED.findall(plain)] if _TUNED.fullmatch(plain) else None


def _other_gains(text: str, source: str) -> list[tuple[str, str, int]]:
    """Return name, value and line of the gains of a bed, or in comments where there are no others."""
    ways: tuple[list[tuple[str, str, int]], list[tuple[str, str, int]]] = ([], [])
    for line, content in lines_of(text):
        plain = _SAID.sub("", content).strip()
        way = ways[plain.startswith((";", "//"))]
        if match := _OTHER_GAIN.match(plain):
            way += [(name, value, line) for name, value in _m301(match[1].partition(";")[0].strip(), line, source)]
        elif match := _OTHER_DEFINE.match(plain):
            way.append((match[1].removeprefix("DEFAULT_").removeprefix("bed").replace("MAX_BED_POWER", "PID_MAX"),
                        match[2].strip("() "), line))
    return ways[0] or ways[1]


def _m301(given: str, line: int, source: str) -> list[tuple[str, str]]:
    letters = _LETTER.findall(given)
    if _LETTER.sub("", given).strip() or not letters:
        raise wrong(source, line, "M301", given, "P, I and D, each with a number")
    found = []
    for letter, value in letters:
        if letter.upper() == "E" and value not in ("0", ""):
            raise wrong(source, line, "M301", f"E{value}", "one hot end, E0")
        if letter.upper() in _LETTERS:
            found.append((_LETTERS[letter.upper()], value))
    return found


def _loops(sample_time_s: float | None) -> int:
    return LEAST_LOOPS if sample_time_s is None else min(max(round(sample_time_s / LOOP_S), LEAST_LOOPS), 16)
