"""Marlin's PID: its words, its law (`WINDOW` of `firmware.parallel`), the lines of Configuration.h and the G-code.

The law is that of temperature.h, PID_t, 2.1; gains are in units of 255, and what the firmware was built with is a word.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping, Sequence
from functools import partial
from typing import Annotated, Final, NamedTuple

from heatertune.errors import InputError
from heatertune.pid.design_values import Timer
from heatertune.plc.controller import Controller
from heatertune.plc.cpu.statement_translation import in_ascii
from heatertune.plc.exported import TextSettings
from heatertune.plc.firmware.firmware_pid import FirmwarePid, controller_of, gain_fields, texts_of
from heatertune.plc.firmware.firmware_text import UNKNOWN, commented, heater_open_point, sensor_line, several
from heatertune.plc.firmware.parallel import (
    COLD,
    PARALLEL,
    WINDOW,
    ParallelParameters,
    ParallelState,
    compute_call,
    narrowed_to,
    quotient,
    scan_result,
)
from heatertune.plc.open_points import OpenPoint
from heatertune.plc.ramp import Number
from heatertune.plc.readback import (
    ReadBack,
    WordCollector,
    demand_whole_lines,
    first_few,
    lines_of,
    real_of,
    whole_of,
    wrong,
)
from heatertune.plc.single_precision import single
from heatertune.plc.words import Certificate, WordField, Words

__all__ = ["Marlin"]

#: of the converter of 10 bits; the sum of 16 readings is finer where they differ
COUNTS: Final = 1023
#: 16 samples of a timer of 1000 Hz [s]
LOOP_S: Final = 0.016
LEAST_LOOPS: Final = 10
_MOST_LOOPS: Final = 16
#: PID_dT of a build with few sensors; those of others are read, not designed: no word of a running firmware changes it
TIMER: Final = Timer(shortest_s=LEAST_LOOPS * LOOP_S, longest_s=LEAST_LOOPS * LOOP_S, step_s=LOOP_S)

GAINS: Final = gain_fields(("Kp", "Ki", "Kd"), "M301, M304 {}", "REAL", (
    "proportional gain, 1/255 of full power per °C", "integral gain Kp/TN, per second",
    "derivative gain Kp·TV, seconds"))
SETTINGS: Final = (
    WordField(name="PID_MAX", address="Configuration.h", format="BYTE", low=1, high=255,
              comment="upper limit of the output, of 255"),
    WordField(name="PID_FUNCTIONAL_RANGE", address="Configuration.h", format="BYTE", low=1, high=255,
              comment="farther from the setpoint than this, °C, the heater is full on or off and I is reset"),
    WordField(name="PID_K1", address="Configuration.h", format="REAL", low=0.0, high=single(0.999),
              comment="weight of its own past in the derivative part"),
    WordField(name="ADC_LOOPS", address="ACTUAL_ADC_SAMPLES", format="BYTE", low=LEAST_LOOPS, high=_MOST_LOOPS,
              comment="states of the sensor reading, 10 or more: PID_dT is 16 of each"),
)
FIELDS: Final = (*GAINS, *SETTINGS)

#: what a firmware has that nobody changed
USUAL: Final[dict[str, Number]] = {
    "PID_MAX": 255, "PID_FUNCTIONAL_RANGE": 10, "PID_K1": single(0.95), "ADC_LOOPS": LEAST_LOOPS,
}


def _oddities(values: Mapping[str, Number]) -> Iterator[str]:
    return (f"{name} is {values[name]:g}, not {usual:g}." for name, usual in USUAL.items()
            if name != "ADC_LOOPS" and values[name] != usual)


_OVERSAMPLED: Final = 16.0
_HZ: Final = 1000.0
_AVR_HZ: Final = 976.5625  # 16 MHz/64/256
_STEPS: Final = 127.0


HEATER: Final = heater_open_point(
    ("hotend", "bed"), "M301 and DEFAULT_Kp of a hot end, or M304 and DEFAULT_bedKp of a bed; if it is unknown, the "
                       "exported files contain both as comments")


class MarlinAssumptions(NamedTuple):
    """The points that depend on the build, see DIFFERENCES.md."""

    avr: Annotated[bool, OpenPoint(
        name="timer", means={"1000hz": False, "977hz": True},
        reason="frequency of the temperature timer, which scales I and D: 1000 Hz, or 976.5625 Hz on a 16 MHz AVR",
    )] = False
    inside: Annotated[bool, OpenPoint(
        name="history", means={"all": False, "inside": True},
        reason="previous reading for the D part: that of every update (2.0, and again since March 2024), or the"
               " last one inside the window, 0 at power-on (2.1.0 to 2.1.2)",
    )] = False
    heater: Annotated[int, HEATER] = 0


def _parameters(values: Mapping[str, float], assume: MarlinAssumptions) -> ParallelParameters:
    """Return the gains as the firmware keeps them: I times PID_dT, D divided by it."""
    interval = single(_OVERSAMPLED * values["ADC_LOOPS"] / (_AVR_HZ if assume.avr else _HZ))
    ki, high = single(values["Ki"] * interval), float(values["PID_MAX"])
    return ParallelParameters(
        law=WINDOW, narrow=True, kp=float(values["Kp"]), ki=ki, kd=narrowed_to(True, values["Kd"] / interval), low=0.0,
        high=high, least=0.0, most=quotient(True, high, ki), full=_STEPS, interval=interval,
        window=float(values["PID_FUNCTIONAL_RANGE"]), weight=single(1.0 - values["PID_K1"]), inside=assume.inside)


def _scan(
    p: ParallelParameters, state: ParallelState, inputs: Mapping[str, float]
) -> tuple[ParallelState, float, float, int]:
    """Compute one update; a target of 0 is off."""
    return scan_result(p, compute_call(p, state, float(inputs["target"]), float(inputs["celsius"]), p.interval))


_NUMBER: Final = r"[-+]?(?:\d+\.?\d*|\.\d+)"
#: what a host program writes before a line of the printer's: arrows, date and time, direction, number of the line
_SAID: Final = re.compile(
    r"^[<>\s]*(?:\[?(?:\d{4}-\d\d-\d\d[ T])?\d{1,2}:\d\d:\d\d(?:[.,]\d+)?(?:\s*[AP]M)?\]?[\s:|<>-]*)?"
    r"(?:(?:Recv|Send|Sending|Sent|READ)\b\s*:?\s*)?[<>\s]*(?:N\d+\s+(?=M))?(?:echo:\s*)?", re.IGNORECASE)
_CHECKSUM: Final = re.compile(r"\*\d+$")
_DEFINE: Final = re.compile(r"#\s*define\s+(\w+)\s*(.*?)\s*(?://.*|/\*.*)?$")
_GAIN: Final = re.compile(r"M30([14])\b(.*)", re.IGNORECASE)
_LETTER: Final = re.compile(rf"([PIDCLFEHST])\s*({_NUMBER})?(?=\s|[A-Z]|$)", re.IGNORECASE)
_TUNED: Final = re.compile(rf"(?:\s*K[pid]:\s*{_NUMBER})+\s*")
#: the answer of some editions to M301 and M304
_ANSWERED: Final = re.compile(rf"(?:ok\s+)?p:\s*({_NUMBER})\s+i:\s*({_NUMBER})\s+d:\s*({_NUMBER})(?:\s+[clf]:.*)?",
                              re.IGNORECASE)
#: what a cycle of M303 measured, from which its gains follow
_CYCLE: Final = re.compile(r"\bKu:", re.IGNORECASE)
_FINISHED: Final = re.compile(r"PID Autotune finished", re.IGNORECASE)
_MORE_TERMS: Final = re.compile(r"M301\b.*\b[CF]\s*0*\.?0*[1-9]", re.IGNORECASE)
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
_TWO_DECIMALS: Final = re.compile(r"echo:.*M30[14]", re.IGNORECASE)


class _Entry(NamedTuple):
    """One word of a text.

    Attributes:
        name, value: of the word.
        line: its number.
        heater: whose it is, a setting of `HEATER`; unknown: of whichever there is.
        is_comment: whether the firmware does not see it.
        is_cycle: whether it is what a cycle of M303 found, of which the last one counts.
    """

    name: str
    value: str
    line: int
    heater: str = UNKNOWN
    is_comment: bool = False
    is_cycle: bool = False


def from_text(text: str, sample_time_s: float | None, source: str, heater: str = UNKNOWN) -> ReadBack:
    """Return the words in a text; what only the build knows is as usual where the text does not tell it.

    Gains in comments are read where there are no others.

    Args:
        text: of Configuration.h, G-code, or what M503 or M303 prints.
        sample_time_s: interval of the loop [s]; None: the least.
        source: name for error messages.
        heater: whose gains are read, a setting of `HEATER`; unknown: those of the only heater.

    Raises:
        InputError: a gain that is missing, there with two values or no number; M301 of a second hot end; different
            gains of a hot end and a bed, and which one's is unknown; none of this heater.
    """
    demand_whole_lines(text, source)
    collected, over, others = WordCollector(source, FIELDS), list[str](), list[str]()
    entries = list[_Entry]()
    for line, content in lines_of(text):
        line_entries = _line(content, line, source)
        if _CYCLE.search(content) or (line_entries and line_entries[0].is_cycle and line_entries[0].name == "Kp"):
            entries = [entry for entry in entries if not entry.is_cycle]
        entries += line_entries
        if not line_entries and content and not content.startswith((";", "//")):
            others.append(f"{content[:40]} (line {line})")
        if _TWO_DECIMALS.search(content):
            over.append(f"M503 prints two decimals (line {line}): the firmware's gains may be half a digit off these")
        if _MORE_TERMS.search(content):
            over.append(f"terms for extrusion or fan (line {line}), which are not run")
    if any(entry.is_cycle for entry in entries) and not _FINISHED.search(text):
        over.append("M303 did not finish: the gains are those of its last cycle")
    for entry in _of_heater(entries, source, heater):
        collected.put(entry.name, _number(entry), entry.line, entry.value)
    if sample_time_s is not None:
        collected.assume({"ADC_LOOPS": _loops(sample_time_s)})
    assumed = collected.assume(USUAL)
    return ReadBack(collected.values(), (*first_few(others), *over), assumed=assumed)


def _number(entry: _Entry) -> int | float | None:
    return (whole_of if entry.name in _WHOLE else real_of)(entry.value)


def _of_heater(entries: Sequence[_Entry], source: str, heater: str) -> Iterator[_Entry]:
    """Yield the words of a heater, with the gains in comments where it has no others."""
    gains = [entry for entry in entries if entry.name in _GAINS]
    if not gains:
        raise InputError(f"{source}: no gain of Marlin's; expected #define DEFAULT_Kp, a line that begins with M301, "
                         "or those of M303")
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
    plain = _CHECKSUM.sub("", _SAID.sub("", content)).strip()
    bare = re.sub(r"^[;/\s]+", "", plain)
    is_comment = plain.startswith((";", "/"))
    if match := _LOOPS.match(bare):
        return [_Entry("ADC_LOOPS", match[1], line)]
    if match := _DEFINE.match(bare):
        return _defined(match[1], match[2], line, source, is_comment=is_comment)
    if match := _GAIN.match(bare):
        heater = "bed" if match[1] == "4" else "hotend"
        try:
            arguments = match[2].partition(";")[0].strip()
            letters = _m301(arguments, line, source) if match[2].strip() else []  # without, it asks for the gains
        except InputError:
            if not is_comment:
                raise
            return []  # prose about the command
        return [_Entry(name, value, line, heater, is_comment) for name, value in letters]
    if match := _ANSWERED.fullmatch(plain):
        return [_Entry(name, value, line) for name, value in zip(_LETTERS.values(), match.groups(), strict=True)]
    return [_Entry(name, value, line, is_cycle=True) for name, value in _ONE_TUNED.findall(plain)
            ] if _TUNED.fullmatch(plain) else []


def _defined(name: str, value: str, line: int, source: str, *, is_comment: bool) -> list[_Entry]:
    """Return the word that a line of Configuration.h defines, if it is one."""
    if _OTHERS.fullmatch(name) and not is_comment:
        raise wrong(source, line, name, value, "one hot end: a list has several")
    word, heater = _DEFINED.get(name, ("", ""))
    return [_Entry(word, value.strip("() fF"), line, heater, is_comment)] if word else []


def _m301(text: str, line: int, source: str) -> list[tuple[str, str]]:
    letters = _LETTER.findall(text)
    if _LETTER.sub("", text).strip() or not letters:
        raise wrong(source, line, "M301", text, "P, I and D, each with a number")
    pairs = []
    for letter, value in letters:
        if letter.upper() == "E" and value not in ("0", ""):
            raise wrong(source, line, "M301", f"E{value}", "one hot end, E0: leave out the lines of the others")
        if letter.upper() in _LETTERS:
            pairs.append((_LETTERS[letter.upper()], value))
    return pairs


def _loops(sample_time_s: float) -> int:
    return min(max(round(sample_time_s / LOOP_S), LEAST_LOOPS), _MOST_LOOPS)


def _settings(file: str, text: str) -> TextSettings:
    return TextSettings(from_text(text, None, file).values)


_HEADER: Final = "marlin_pid.h"
_CODE: Final = "marlin_pid.gcode"
_BUILT_WITH: Final = {"hotend": "PIDTEMP, of a single hot end; no lists per hot end", "bed": "PIDTEMPBED"}
_OF: Final = {UNKNOWN: "", "hotend": " of a hot end", "bed": " of the bed"}
_WHICH: Final = ("gains of which heater? take the lines of yours without the sign of a comment, or design with "
                 "--assume heater=hotend or heater=bed")


def _export(words: Words, certificate: Certificate) -> dict[str, str | bytes]:
    """Return both files; the same words and certificate give the same bytes."""
    heater, texts = certificate.switches.get("heater", UNKNOWN), texts_of(words, FIELDS)
    limit = "MAX_BED_POWER" if heater == "bed" else "PID_MAX"
    names = {limit: "PID_MAX", "PID_FUNCTIONAL_RANGE": "PID_FUNCTIONAL_RANGE", "PID_K1": "PID_K1"}
    built = [f"#define {name} {texts[word]}" for name, word in names.items()]
    loops = f"ADC_LOOPS = {words.whole['ADC_LOOPS']}"
    head = _head(words, certificate, heater)
    header = commented("//", *head) + "//\n" + "\n".join([
        *_defaults(texts, heater), *built, f"// {loops}: PID_dT of the build is 16 of these by the timer's frequency"])
    code = [";", "; the firmware has to be built with these, no G-code sets them:", *[f"; {line}" for line in built],
            f"; {loops}", ";", "; before: send M503 and keep what it prints; M501 goes back to what was saved last",
            *_commands(texts, heater), "M503 S0", "; when it has worked: M500 saves it"]
    return {_HEADER: header + "\n", _CODE: commented(";", *head) + "\n".join(code) + "\n"}


def _defaults(texts: Mapping[str, str], heater: str) -> list[str]:
    """Return the gains as lines of Configuration.h: of the heater, or as comments of both while it is unknown."""
    of = {kind: [f"#define DEFAULT_{kind}{field.name} {texts[field.name]}" for field in GAINS] for kind in ("", "bed")}
    if heater != UNKNOWN:
        return [f"// Configuration.h, with {_BUILT_WITH[heater]}", *of["bed" if heater == "bed" else ""]]
    return [f"// {_WHICH}", "// of a single hot end (PIDTEMP):", *(f"// {line}" for line in of[""]),
            "// of a bed (PIDTEMPBED; MAX_BED_POWER in the place of PID_MAX):", *(f"// {line}" for line in of["bed"])]


def _commands(texts: Mapping[str, str], heater: str) -> list[str]:
    """Return the G-code that sets the gains of the heater; comments of both while it is unknown."""
    gains = " ".join(f"{field.address[-1]}{texts[field.name]}" for field in GAINS)
    if heater != UNKNOWN:
        return [f"{'M304' if heater == 'bed' else 'M301'} {gains}"]
    return [f"; {_WHICH}", f"; M301 {gains}", "; or, for a bed:", f"; M304 {gains}"]


def _head(words: Words, certificate: Certificate, heater: str) -> tuple[str, ...]:
    kp_pct, most_pct = (100.0 * words.values[name] / 255.0 for name in ("Kp", "PID_MAX"))
    return (
        f"heater controller for Marlin's PID{_OF[heater]}",
        sensor_line(words, f" (PID_dT of a 1000 Hz timer); Kp is {kp_pct:.4g} % per degC; at most {most_pct:.4g} %"),
        *map(in_ascii, certificate.head),
        "pulses: the firmware's own, 127 steps of the timer",
    )


_ROUNDED_DEGC: Final = 0.5  # the setpoint, to whole degrees


def _again_degC(_self: Controller, words: Words) -> float | None:
    """Return the firmware's window, less what the rounded setpoint and the reading's steps may take of it."""
    return float(words.values["PID_FUNCTIONAL_RANGE"]) - _ROUNDED_DEGC - words.scaling.span_degC / COUNTS


def _forgets_degC(_self: Controller, words: Words) -> float | None:
    """Return the window, and what may be added to it."""
    return float(words.values["PID_FUNCTIONAL_RANGE"]) + _ROUNDED_DEGC + words.scaling.span_degC / COUNTS


Marlin = controller_of(FirmwarePid(
    name="marlin", title="Marlin 2.1, PID of a hot end (Marlin/src/module/temperature.h; M301)", main_file=_HEADER,
    can=(
        "P, PI, PD and PID in single precision, D on the reading and filtered (PID_K1)",
        "full power below the window PID_FUNCTIONAL_RANGE around the setpoint, none above",
        "exported as lines of Configuration.h and as G-code: M301, or M304 of a bed (`--assume heater=bed`)",
    ),
    cannot=(
        "127 steps of power; the setpoint is whole degrees",
        "TA is PID_dT: 0.16 s, or up to 0.256 s where words are read of a build with many sensors",
        "no setpoint ramp, no boost of heatertune's: outside the window the firmware gives full power itself",
        "no coolers; no terms for extrusion and fan (PID_EXTRUSION_SCALING, PID_FAN_SCALING)",
        "the firmware's own supervision (MINTEMP, MAXTEMP, thermal runaway) is not simulated",
    ),
    inputs={"target": "REAL", "celsius": "REAL"}, counts=COUNTS, timer=TIMER,
    gains=GAINS, settings=SETTINGS, full=255.0, usual=USUAL, interval=("ADC_LOOPS", LOOP_S),
    method="as Marlin's words realise it", lag=lambda values: float(values["PID_K1"]), oddities=_oddities,
    law=PARALLEL, cold=COLD, assumptions=MarlinAssumptions, parameters=_parameters,
    export=_export, text=from_text, settings_in={name: partial(_settings, name) for name in (_HEADER, _CODE)},
    further={
        "tick_s": 0.001, "pwm_period_s": 0.127, "derivative_filter": 0.95, "scan_all": staticmethod(_scan),
        "text_of_heater": staticmethod(from_text), "again_degC": _again_degC, "forgets_degC": _forgets_degC,
        "window": "PID_FUNCTIONAL_RANGE",
    },
))
