"""The monitor as statements of structured text, from which the text of each target is printed.

They are as simple as the simplest target: whole numbers, no loop, no array, and each statement under one comparison at
most. The last blocks are cells in a row, moved on by one at the end of each block. Only `Margin` needs 32 bits wherever
sensor and window are small; a rule that is off leaves no statement.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from typing import Final, NamedTuple

from heatertune.errors import InputError
from heatertune.plc.print.statements import Group, if_
from heatertune.supervision.monitor import ALARMS, Numbers

__all__ = ["INPUTS", "MARGIN", "OUTPUTS", "WIDE", "Statements", "alarm_text", "check_reach", "statements_of"]


#: what the monitor is given, what it gives
INPUTS: Final = {"Reading": "count of the card", "Power": "asked for, whole percent"}
OUTPUTS: Final = {"Alarm": "of this call, 0: none", "Told": "the first alarm; stays until you write 0"}
#: the one cell that needs 32 bits
MARGIN: Final = "Margin"

_CELLS: Final = {
    "Begun": "0: begin anew, as after a start-up", "Last": "reading of the call before", "Jump": "size of its move",
    "In_Block": "calls in this block", "Level": "sum of its readings", "Asked": "sum of its powers",
    "Blocks": "blocks since the start-up", "Full_For": "calls with full power asked for",
    "Still": "calls with the same reading", "Held": "power when the reading moved last",
    "Away": "how far the power is from there", "Moving": "1: it was far from there",
    "Moved_For": "calls with the same reading since then", "Way": "of the level: 1 rises, -1 falls, 0 not known",
    "Top": "highest level since it rises", "Bottom": "lowest level since it falls", "Fall": "from the highest level",
    "Rise": "from the lowest level", "Turn": "where the level turns to: 1 up, -1 down", "Swing": "size of this swing",
    "Swung": "size of the swing before", "Grew": "swings in a row that grew", "More": "the same with this one",
    "Moved": "how far the level went over the window", "Window": "sum of powers of a window",
    "Cause": "the one that counts", MARGIN: "what is left to the limit; below 0: alarm",
    "Say": "which alarm it is then", "Found": "alarm of this block",
}


class Statements(NamedTuple):
    """A monitor.

    Attributes:
        block: calls of a block.
        each_call: run in each call.
        each_block: then, where a block is over: `In_Block` has reached `block`.
        cells: name → meaning, beside inputs and outputs.
    """

    block: int
    each_call: tuple[Group, ...]
    each_block: tuple[Group, ...]
    cells: Mapping[str, str]


def statements_of(numbers: Numbers) -> Statements:
    """Return the statements of a monitor; the same numbers give the same text."""
    each_call, each_block = tuple(_each_call(numbers)), tuple(_each_block(numbers))
    text = "".join(group.lines for group in each_call + each_block)
    levels, powers = _history_sizes(numbers)
    rows = {f"{of}_{back}": f"{what} of {_ago(back)}"
            for of, what, count in (("Level", "sum of readings", levels), ("Power", "sum of powers", powers))
            for back in range(count)}
    used = {name: meaning for name, meaning in _CELLS.items() if f"{name} :=" in text}
    return Statements(numbers.block, each_call, each_block, used | rows)


def alarm_text() -> str:
    """Return the names of the alarms, in one line."""
    return ", ".join(f"{number} {name}" for number, name in enumerate(ALARMS) if number)


def _ago(blocks: int) -> str:
    return ("the last block", "the block before")[blocks] if blocks < 2 else f"{blocks} blocks before the last"


def _alarm(name: str) -> int:
    return ALARMS.index(name)


def _history_sizes(numbers: Numbers) -> tuple[int, int]:
    """Return how many levels and sums of powers are kept."""
    window = max(numbers.slow_blocks, numbers.fast_blocks)
    return window + 1, numbers.delay_high + window if window else 0


def _each_call(numbers: Numbers) -> Iterator[Group]:
    full, still, moved_for = numbers.full, numbers.still, numbers.still_moved
    begins = ["Begun := 1", "Last := Reading", "In_Block := 0", "Level := 0", "Asked := 0", "Blocks := 0"]
    begins += ["Full_For := 0"] if full else []
    begins += ["Still := -1"] if still else []
    begins += ["Held := Power", "Moving := 0", "Moved_For := 0"] if moved_for else []
    begins += ["Way := 0", "Swung := 0", "Grew := 0"] if numbers.growths else []
    yield Group("start-up: nothing is known", if_("Begun = 0", *begins))
    yield Group("how far the reading moved", "Alarm := 0;\nJump := Reading - Last;\n"
                + if_("Jump < 0", "Jump := Last - Reading") + "Last := Reading;\n")
    if full:
        yield Group("setpoint out of reach: full power for too long", (
            if_(f"Full_For <= {full}", "Full_For := Full_For + 1") + if_("Power < 100", "Full_For := 0")
            + if_(f"Full_For > {full}", f"Alarm := {_alarm('setpoint out of reach')}")))
    if still:
        yield Group("frozen: the same reading for too long", (
            if_(f"Still <= {still}", "Still := Still + 1") + if_("Jump > 0", "Still := 0")
            + if_(f"Still > {still}", f"Alarm := {_alarm('frozen')}")))
    if moved_for:
        yield Group("frozen: the same reading although the power has moved", (
            "Away := Power - Held;\n" + if_("Away < 0", "Away := Held - Power")
            + if_(f"Away >= {numbers.moved}", "Moving := 1")
            + if_(f"Moved_For <= {moved_for}", "Moved_For := Moved_For + Moving")
            + if_("Jump > 0", "Moving := 0", "Moved_For := 0", "Held := Power")
            + if_(f"Moved_For > {moved_for}", f"Alarm := {_alarm('frozen')}")))
    yield Group("implausible rate", if_(f"Jump > {numbers.jump}", f"Alarm := {_alarm('implausible rate')}"))
    alarm = f"Alarm := {_alarm('sensor gone')}"
    yield Group("sensor gone", if_(f"Reading < {numbers.low}", alarm) + if_(f"Reading > {numbers.high}", alarm))
    yield Group("sums of this block; the first alarm is kept", (
        "Level := Level + Reading;\nAsked := Asked + Power;\nIn_Block := In_Block + 1;\n"
        + if_("Told = 0", "Told := Alarm")))


def _each_block(numbers: Numbers) -> Iterator[Group]:
    levels, powers = _history_sizes(numbers)
    moved = [f"{of}_{back} := {of}_{back - 1}" for of, count in (("Level", levels), ("Power", powers))
             for back in range(count - 1, 0, -1)]
    ends = ["Level_0 := Level", *(["Power_0 := Asked"] if powers else []), "Level := 0", "Asked := 0", "In_Block := 0",
            "Found := 0"]
    least = numbers.delay_high + levels
    yield Group("a block is over: all move on by one", (
        "".join(f"{each};\n" for each in moved + ends) + if_(f"Blocks < {least}", "Blocks := Blocks + 1")))
    if numbers.growths:
        yield from _swings(numbers)
    if numbers.slow_blocks:
        blocks = numbers.slow_blocks
        yield Group("least sum of powers that may have caused the movement", _cause(numbers, blocks, "<"))
        margin = (numbers.slow_scale, -numbers.slow_gain, numbers.slow_loss, -numbers.slow_rest)
        yield Group("heats too slowly, or falls although heated", (
            _margin(numbers, blocks, margin) + f"Say := {_alarm('heats too slowly')};\n"
            + if_(f"Moved <= {-numbers.swing}", f"Say := {_alarm('falls although heated')}")
            + if_(f"{MARGIN} < 0", "Found := Say")))
    if numbers.fast_blocks:
        blocks = numbers.fast_blocks
        yield Group("largest sum of powers that may have caused the movement", _cause(numbers, blocks, ">"))
        margin = (-numbers.fast_scale, numbers.fast_gain, -numbers.fast_loss, numbers.fast_rest)
        yield Group("too hot for its power", (
            _margin(numbers, blocks, margin)
            + if_(f"{MARGIN} < 0", f"Found := {_alarm('too hot for its power')}")))
    yield Group("an alarm of the call comes first; the first of all is kept", (
        if_("Alarm = 0", "Alarm := Found") + if_("Told = 0", "Told := Alarm")))


def _cause(numbers: Numbers, blocks: int, better: str) -> str:
    """Return the statements that find the least or largest sum of powers of so many blocks in a row."""
    low, high = numbers.delay_low, numbers.delay_high
    text = f"Window := {' + '.join(f'Power_{low + back}' for back in range(blocks))};\nCause := Window;\n"
    for delay in range(low + 1, high + 1):
        text += f"Window := Window + Power_{delay + blocks - 1} - Power_{delay - 1};\n"
        text += if_(f"Window {better} Cause", "Cause := Window")
    return text


def _margin(numbers: Numbers, blocks: int, factors: tuple[int, ...]) -> str:
    """Return the statements of the movement and its margin: factors of movement, cause and level, and what is added."""
    *products, rest = factors
    terms = [(rest, f"{abs(rest)}"), *((factor, f"{abs(factor)} * {what}") for factor, what in zip(
        products, ("Moved", "Cause", f"Level_{blocks}"), strict=True) if factor)]
    total = "".join(f" {'-' if factor < 0 else '+'} {text}" for factor, text in terms)
    return (f"Moved := Level_0 - Level_{blocks};\n{MARGIN} :={total.replace(' + ', ' ', 1) if rest >= 0 else total};\n"
            + if_(f"Blocks <= {blocks + numbers.delay_high}", f"{MARGIN} := 0"))


def _swings(numbers: Numbers) -> Iterator[Group]:
    swing = numbers.swing
    yield Group("how far the level is from its ends", (
        if_("Blocks = 1", "Top := Level_0", "Bottom := Level_0")
        + "Fall := Top - Level_0;\nRise := Level_0 - Bottom;\n"
        + if_("Way < 0", "Fall := 0") + if_("Way > 0", "Rise := 0")
        + if_("Fall < 0", "Top := Level_0") + if_("Rise < 0", "Bottom := Level_0")))
    yield Group("does it turn, and was the swing larger than the one before?", (
        f"Turn := 0;\n{if_(f'Rise >= {swing}', 'Turn := 1')}{if_(f'Fall >= {swing}', 'Turn := -1')}"
        "Swing := Top - Bottom;\nMore := Grew + 1;\n"
        + if_("Swing <= Swung", "More := 0") + if_("Swung = 0", "More := 0")
        + if_("Way = 0", "More := 0", "Swing := 0")
        + if_("Turn > 0", "Way := 1", "Top := Level_0", "Swung := Swing", "Grew := More")
        + if_("Turn < 0", "Way := -1", "Bottom := Level_0", "Swung := Swing", "Grew := More")))
    yield Group("swing grows", if_(f"Grew >= {numbers.growths}", f"Found := {_alarm('swing grows')}"))


def check_reach(numbers: Numbers, highest: int, bits: int) -> None:
    """Refuse a monitor whose cells cannot hold what its card may give.

    Args:
        numbers: of the monitor.
        highest: count of the card, from 0 on.
        bits: of each cell but `Margin`, which has 32; the factors before cells are as wide.

    Raises:
        InputError: it does not fit; the error tells which number.
    """
    window, level = max(numbers.slow_blocks, numbers.fast_blocks), numbers.block * highest
    powers = 100 * numbers.block * window
    sums = {"the sum of a block's readings": level, "the sum of a window's powers": powers} | {
        name: abs(value) for name, value in numbers._asdict().items() if not name.endswith("_rest")}
    for name, value in sums.items():
        if value >= 1 << bits - 1:
            raise InputError(f"no program: {name} may be {value}, which {bits} bits do not hold")
    for of in ("slow", "fast"):
        scale, gain, loss, rest = (getattr(numbers, f"{of}_{name}") for name in ("scale", "gain", "loss", "rest"))
        most = scale * level + gain * powers + loss * level + abs(rest)
        if most >= 1 << 31:
            raise InputError(f"no program: what the {of} rule adds up may be {most}, which 32 bits do not hold")


#: cells that are twice as wide as the others where these are words
WIDE = MARGIN.upper()
