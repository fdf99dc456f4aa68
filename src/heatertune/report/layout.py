"""Text layout for the terminal: wrapped to its width, in columns, at most one screen."""

from __future__ import annotations

import shlex
import textwrap
from collections.abc import Mapping, Sequence
from typing import Final

__all__ = [
    "LINES", "WIDTH", "command", "cut", "labelled_lines", "notes_within", "screen", "table", "two_columns", "wrap_text",
]

#: columns and lines of a default terminal, without those of the prompt
WIDTH: Final = 80
LINES: Final = 30

_GAP: Final = "  "


def table(rows: Sequence[Sequence[str]], *, right: Sequence[int] = ()) -> str:
    """Return rows as aligned columns; the columns named in `right` are aligned to the right."""
    widths = [max(len(row[i]) for row in rows) for i in range(len(rows[0]))]
    lines = []
    for row in rows:
        padded = enumerate(zip(row, widths, strict=True))
        cells = [cell.rjust(width) if i in right else cell.ljust(width) for i, (cell, width) in padded]
        lines.append(_GAP.join(cells).rstrip())
    return "\n".join(lines)


def two_columns(rows: Sequence[Sequence[str]], *, right: Sequence[int] = ()) -> list[str]:
    """Return rows as aligned columns, in two halves side by side where the terminal is wide enough."""
    single = table(rows, right=right).splitlines()
    half = (len(rows) + 1) // 2
    if half < 2 or 2 * max(map(len, single)) + 2 * len(_GAP) > WIDTH:
        return single
    width = max(map(len, single[:half]))
    return [f"{left:<{width}}{_GAP * 2}{other}".rstrip()
            for left, other in zip(single[:half], [*single[half:], ""], strict=False)]


def cut(text: str, width: int = WIDTH) -> str:
    """Return a text, or its beginning where it is wider."""
    return text if len(text) <= width else f"{text[:max(0, width - 1)].rstrip()}…"


def wrap_text(text: str, first: str = "", most: int | None = None) -> list[str]:
    """Wrap a text to the width of the terminal, with a hanging prefix in its own columns.

    Args:
        text: one paragraph.
        first: before its first line.
        most: largest number of lines, the last one truncated; None: unlimited.
    """
    lines = textwrap.wrap(text, WIDTH, initial_indent=first, subsequent_indent=" " * len(first), max_lines=most,
                          placeholder=" …", break_on_hyphens=False)
    return lines or [first.rstrip()]


def labelled_lines(parts: Mapping[str, Sequence[str]], most: int) -> list[str]:
    """Return parts after their labels, within a number of lines.

    The last parts of the longest label are omitted first, and counted; if there are more labels than lines, the last
    line counts the parts of the remaining labels.

    Args:
        parts: label → a few words each, the most important first; a label without parts is omitted.
        most: largest number of lines, at least 1.
    """
    entries = {label: list(of) for label, of in parts.items() if of}
    left = dict.fromkeys(entries, 0)
    width = max(map(len, entries), default=0) + len(_GAP)

    def lines(most_each: int | None = None) -> list[str]:
        texts = {label: "; ".join([*of, *([f"and {left[label]} more"] if left[label] else [])])
                 for label, of in entries.items()}
        return [line for label, text in texts.items() for line in wrap_text(text, f"{label:<{width}}", most_each)]

    while len(lines()) > most and any(len(of) > 1 for of in entries.values()):
        longest = max(entries, key=lambda label: (len(entries[label]) > 1, sum(map(len, entries[label]))))
        entries[longest].pop()
        left[longest] += 1
    if len(lines()) <= most or len(lines(1)) <= most:
        return lines() if len(lines()) <= most else lines(1)
    beyond = list(entries)[most - 1:]
    counted = ", ".join(f"{label} ({len(parts[label])})" for label in beyond)
    for label in beyond:
        del entries[label]
    return [*lines(1), *wrap_text(f"{counted}: --verbose", f"{'more':<{width}}", 1)]


def command(words: Sequence[str]) -> list[str]:
    """Return a command that can be copied: its lines are one for the shell."""
    groups: list[str] = []
    for word in map(shlex.quote, words):
        if groups and not word.startswith("-"):
            groups[-1] += f" {word}"
        else:
            groups.append(word)
    lines = [f"  {groups[0]}"]
    for group in groups[1:]:
        if len(lines[-1]) + len(group) + len("  \\") > WIDTH:
            lines[-1] += " \\"
            lines.append(f"    {group}")
        else:
            lines[-1] += f" {group}"
    return lines


def notes_within(room: int, notes: Sequence[str], hidden: int = 0) -> list[str]:
    """Return as many notes as fit, as items, and the number of the others.

    Args:
        room: largest number of lines, including one for the number of omitted notes.
        notes: to show, the most important first.
        hidden: number of further notes that are never shown.
    """
    lines = list[str]()
    for number, note in enumerate(notes):
        more = wrap_text(note, "- ")
        if len(lines) + len(more) >= room:
            hidden += len(notes) - number
            break
        lines += more
    return [*lines, *([f"- {hidden} more: --verbose"] if hidden else [])]


def screen(*parts: Sequence[str]) -> str:
    """Return parts with an empty line between them, as far as a screen has room for empty lines."""
    shown = [list(part) for part in parts if part]
    room = LINES - sum(map(len, shown))
    for part in shown[1:]:
        if room > 0:
            part.insert(0, "")
            room -= 1
    return "\n".join(line for part in shown for line in part)
