"""Words → lines for Configuration.h, and G-code that sets the gains of a firmware that runs.

Marlin's gains in text: Configuration.h, G-code, what M503 prints, and what M303 prints at its end.

What the lines for Configuration.h and the G-code set in the firmware.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterator, Mapping, Sequence
from functools import partial
from typing import Final, NamedTuple

from heatertune.errors import InputError
from heatertune.plc.cpu.statements import in_ascii
from heatertune.plc.exported import TextSettings
from heatertune.plc.keyed_entry import entry_texts
from heatertune.plc.marlin.step import MarlinAssumptions
from heatertune.plc.marlin.words import FIELDS, GAINS, LEAST_LOOPS, LOOP_S, USUAL
from heatertune.plc.parallel.words import decimal
from heatertune.plc.printer_heater import UNKNOWN, several
from heatertune.plc.readback import ReadBack, WordCollector, lines_of, real_of, whole_of, wrong
from heatertune.plc.words import Certificate, Words

__all__ = ["entries", "export_words", "from_text", "loaders"]


_NUMBER: Final = r"[-+]?(?:\d+\.?\d*|\.\d+)"
#: what a host program writes before a line of the printer's
_SAID: Final = re.compile(r"^(?:(?:Recv|Send|READ|SENT|>>>|<<<)\s*:?\s*)?(?:echo:\s*)?", re.IGNORECASE)
_DEFINE: Final = re.compile(r"#\s*define\s+(\w+)\s*(.*?)\s*(?://.*|/\*.*)?$")
_GAIN: Final = re.compile(r"M30([14])\b(.*)", re.IGNORECASE)
_LETTER: Final = re.compile(rf"([A-Z])\s*({_NUMBER})?(?=\s|[A-Z]|$)", re.IGNORECASE)
_TUNED: Final = re.compile(rf"(?:\s*K[pid]:\s*{_NUMBER})+\s*")
_ONE_TUNED: Final = re.compile(rf"(K[pid]):\s*({_NUMBER})")
_LOOPS: Final = re.compile(r"ADC_LOOPS\s*=\s*(\S+?):?(?:\s|$)")
_LETTERS: Final = {"P": "Kp", "I": "Ki", "D": "Kd"}
_GAINS: Final = frozenset(_LETTERS.values())
#: how a message calls the heaters
_HEADS: Final = {"hotend": "a hot end", "bed": "a bed"}
#: name in Configuration.h → word, and whose it is
_DEFINED: Final = {
    **{f"DEFAULT_{name}": (name, "hotend") for name in _LETTERS.values()},
    **{f"DEFAULT_bed{name}": (name, "bed") for name in _LETTERS.values()},
    "PID_MAX": ("PID_MAX", "hotend"), "MAX_BED_POWER": ("PID_MAX", "bed"),
    "PID_FUNCTIONAL_RANGE": ("PID_FUNCTIONAL_RANGE", UNKNOWN), "PID_K1": ("PID_K1", UNKNOWN),
}
_OTHERS: Final = re.compile(r"DEFAULT_K[pid]_LIST", re.IGNORECASE)
_WHOLE: Final = frozenset(field.name for field in FIELDS if field.format == "BYTE")
_TWO_DECIMALS: Final = re.compile(r"echo:.*M301", re.IGNORECASE)


class _Entry(NamedTuple):
    """One word of a text.

    Attributes:
        name, value: of the word.
        line: its number.
        heater: whose it is, a setting of `MARLIN_HEATER`; unknown: of whichever there is.
        is_comment: whether the firmware does not see it.
    """

    name: str
    value: str
    line: int
    heater: str = UNKNOWN
    is_comment: bool = False


def from_text(text: str, sample_time_s: float | None, source: str, heater: str = UNKNOWN) -> ReadBack:
    """Return the words in a text; what only the build knows is as usual where the text does not tell it.

    Gains in comments are read where there are no others.

    Args:
        text: of Configuration.h, G-code, or what M503 or M303 prints.
        sample_time_s: interval of the loop [s]; None: the least.
        source: name for error messages.
        heater: whose gains are read, a setting of `MARLIN_HEATER`; unknown: those of the only heater.

    Raises:
        InputError: a gain that is missing, there with two values or no number; M301 of a second hot end; different
            gains of a hot end and a bed, and which one's is unknown; none of this heater.
    """
    collected, over = WordCollector(source, FIELDS), list[str]()
    entries = list[_Entry]()
    for line, content in lines_of(text):
        found = _line(content, line, source)
        entries += found
        if not found and content and not content.startswith((";", "//")):
            over.append(f"{content[:40]} (line {line})")
        if _TWO_DECIMALS.search(content):
            over.append(f"M503 prints two decimals (line {line}): the firmware's gains may be half a digit off these")
    seen: set[str] = set()
    for entry in _of_heater(entries, source, heater):
        seen.add(entry.name)
        collected.put(entry.name, _number(entry), entry.line, entry.value)
    for name in USUAL.keys() - seen:
        usual = USUAL[name] if name != "ADC_LOOPS" else _loops(sample_time_s)
        collected.put(name, usual, 0, str(usual))
        over.append(f"{name} is not set: {usual:g}, the default")
    return ReadBack(collected.values(), tuple(sorted(over)))


def _number(entry: _Entry) -> int | float | None:
    return (whole_of if entry.name in _WHOLE else real_of)(entry.value)


def _of_heater(entries: Sequence[_Entry], source: str, heater: str) -> Iterator[_Entry]:
    """Yield the words of a heater, with the gains in comments where it has no others."""
    gains = [entry for entry in entries if entry.name in _GAINS]
    if not gains:
        raise InputError(f"{source}: no gain of Marlin's; expected #define DEFAULT_Kp, M301 or the lines of M303")
    its = [entry for entry in gains if UNKNOWN in (heater, entry.heater) or entry.heater == heater]
    if not its:
        raise InputError(f"{source}: gains of {_HEADS[gains[0].heater]}; expected those of {_HEADS[heater]}")
    its = [entry for entry in its if not entry.is_comment] or its
    own = {kind: {(entry.name, _number(entry)) for entry in its if entry.heater == kind} for kind in _HEADS}
    there = [kind for kind in _HEADS if own[kind]]
    if heater == UNKNOWN and len(there) > 1 and own[there[0]] != own[there[1]]:
        raise several(source, " and ".join(_HEADS[kind] for kind in there), there)
    whose = heater if heater != UNKNOWN else there[0] if there else UNKNOWN
    yield from (entry for entry in its if UNKNOWN in (whose, entry.heater) or entry.heater == whose)
    others = [entry for entry in entries if entry.name not in _GAINS and entry.heater in (UNKNOWN, whose)]
    live = {entry.name for entry in others if not entry.is_comment}
    yield from (entry for entry in others if not entry.is_comment or entry.name not in live)


def _line(content: str, line: int, source: str) -> list[_Entry]:
    """Return the words of a line."""
    plain = _SAID.sub("", content).strip()
    bare = re.sub(r"^[;/\s]+", "", plain)
    is_comment = plain.startswith((";", "/"))
    if match := _LOOPS.match(bare):
        return [_Entry("ADC_LOOPS", match[1], line)]
    if match := _DEFINE.match(bare):
        return _defined(match[1], match[2], line, source, is_comment=is_comment)
    if match := _GAIN.match(bare):
        heater = "bed" if match[1] == "4" else "hotend"
        try:
            letters = _m301(match[2].partition(";")[0].strip(), line, source)
        except InputError:
            if not is_comment:
                raise
            return []  # prose about the command
        return [_Entry(name, value, line, heater, is_comment) for name, value in letters]
    return [_Entry(name, value, line) for name, value in _ONE_TUNED.findall(plain)] if _TUNED.fullmatch(plain) else []


def _defined(name: str, value: str, line: int, source: str, *, is_comment: bool) -> list[_Entry]:
    """Return the word that a line of Configuration.h defines, if it is one."""
    if _OTHERS.fullmatch(name) and not is_comment:
        raise wrong(source, line, name, value, "one hot end: a list has several")
    word, heater = _DEFINED.get(name, ("", ""))
    return [_Entry(word, value.strip("() "), line, heater, is_comment)] if word else []


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


def loaders(files: Mapping[str, str | bytes], assume: MarlinAssumptions) -> dict[str, Callable[[], TextSettings]]:  # noqa: ARG001
    """Return what reads each file: both set all words."""
    return {file: partial(_settings, file, str(text)) for file, text in files.items()}


def _settings(file: str, text: str) -> TextSettings:
    return TextSettings(from_text(text, None, file).values)


_BUILT_WITH: Final = {"hotend": "PIDTEMP, of a single hot end; no lists per hot end", "bed": "PIDTEMPBED"}
_OF: Final = {UNKNOWN: "", "hotend": " of a hot end", "bed": " of the bed"}
_WHICH: Final = ("gains of which heater? take the lines of yours without the sign of a comment, or design with "
                 "--assume heater=hotend or heater=bed")

_FORMAT = {field.name: field.format for field in FIELDS}


def export_words(words: Words, certificate: Certificate) -> dict[str, str]:
    """Return both files; the same words and certificate give the same bytes."""
    heater = certificate.switches.get("heater", UNKNOWN)
    limit = "MAX_BED_POWER" if heater == "bed" else "PID_MAX"
    names = {limit: "PID_MAX", "PID_FUNCTIONAL_RANGE": "PID_FUNCTIONAL_RANGE", "PID_K1": "PID_K1"}
    built = [f"#define {name} {_text(words, word)}" for name, word in names.items()]
    loops = f"ADC_LOOPS = {words.whole['ADC_LOOPS']}"
    head = _head(words, certificate, heater)
    header = [*[f"// {line}" for line in head], "//", *_defaults(words, heater), *built,
              f"// {loops}: PID_dT of the build is 16 of these by the timer's frequency"]
    code = [*[f"; {line}" for line in head], ";",
            "; the firmware has to be built with these, no G-code sets them:",
            *[f"; {line}" for line in built], f"; {loops}", ";",
            "; before: send M503 and keep what it prints; M501 goes back to what was saved last",
            *_commands(words, heater), "M503 S0", "; when it has worked: M500 saves it"]
    return {"marlin_pid.h": "\n".join(header) + "\n", "marlin_pid.gcode": "\n".join(code) + "\n"}


def _defaults(words: Words, heater: str) -> list[str]:
    """Return the gains as lines of Configuration.h: of the heater, or as comments of both while it is unknown."""
    of = {kind: [f"#define DEFAULT_{kind}{field.name} {_text(words, field.name)}" for field in GAINS]
          for kind in ("", "bed")}
    if heater != UNKNOWN:
        return [f"// Configuration.h, with {_BUILT_WITH[heater]}", *of["bed" if heater == "bed" else ""]]
    return [f"// {_WHICH}", "// of a single hot end (PIDTEMP):", *(f"// {line}" for line in of[""]),
            "// of a bed (PIDTEMPBED; MAX_BED_POWER in the place of PID_MAX):", *(f"// {line}" for line in of["bed"])]


def _commands(words: Words, heater: str) -> list[str]:
    """Return the G-code that sets the gains of the heater; comments of both while it is unknown."""
    gains = " ".join(f"{field.address[-1]}{_text(words, field.name)}" for field in GAINS)
    if heater != UNKNOWN:
        return [f"{'M304' if heater == 'bed' else 'M301'} {gains}"]
    return [f"; {_WHICH}", f"; M301 {gains}", "; or, for a bed:", f"; M304 {gains}"]


def entries(words: Words, _setpoint_degC: float | None, _units: object) -> dict[str, dict[str, str]]:
    """Return each word as the exported files have it, see `heatertune.plc.keyed_entry.TypedWord`."""
    return entry_texts({field.name: _text(words, field.name) for field in FIELDS})


def _text(words: Words, name: str) -> str:
    value = words.values[name]
    return decimal(value, _FORMAT[name]) if _FORMAT[name] == "REAL" else str(value)


def _head(words: Words, certificate: Certificate, heater: str) -> tuple[str, ...]:
    scale, values = words.scaling, words.values
    powers: Mapping[str, float] = {name: 100.0 * values[name] / 255.0 for name in ("Kp", "PID_MAX")}
    return (
        f"heater controller for Marlin's PID{_OF[heater]}",
        f"sensor {scale.low_degC:g}...{scale.high_degC:g} degC; TA: {words.sample_time_s:g} s (PID_dT of a 1000 Hz "
        f"timer); Kp is {powers['Kp']:.4g} % per degC; at most {powers['PID_MAX']:.4g} %",
        *map(in_ascii, certificate.head),
        "pulses: the firmware's own, 127 steps of the timer",
    )
