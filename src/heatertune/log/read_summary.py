"""What was taken of a file as what: one line for people, and the options that repeat the reading."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, field
from typing import Any, Final

__all__ = ["MOST_REPAIRED", "UNIT_OPTIONS", "Option", "ReadSummary"]

#: role → option of `read_log` that states its unit
UNIT_OPTIONS: Final = {"time": "time_unit", "temperature": "temperature_unit", "power": "power_full_scale"}

Option = bool | float | str | None

_ROLES: Final = ("time", "temperature", "power", "setpoint")
#: told where the user names it alone
_NAMED: Final = "disturbance"
#: share of the rows: more is told on the verdict's line
MOST_REPAIRED: Final = 0.01
_SHOWN: Final = 12  # unused columns named


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadSummary:
    """What was taken of a file.

    Attributes:
        file: its name.
        rows: readings in the log.
        interval_s: usual time between two of them [s].
        columns: role → (name of its column or tag, how it was written: "°C", "0…255", "stamps"), absent: none.
        rows_read: rows of the file that could have been readings.
        left_out: how many of them were left out.
        repeats: how many of those repeated the row before, so that nothing was lost.
        repaired: rows in which a value was put in.
        unused: columns or tags that were not used.
        reading: option of `read_log` → what repeats this reading with nothing left to guess.
        assumed: role → option that states its unit, of each unit that neither the file nor the user states.
        stated: roles whose unit the user states by an option.
    """

    file: str
    rows: int
    interval_s: float
    columns: Mapping[str, tuple[str, str]]
    rows_read: int
    left_out: int = 0
    repeats: int = 0
    repaired: int = 0
    unused: tuple[str, ...] = ()
    reading: Mapping[str, Option] = field(default_factory=dict)
    assumed: Mapping[str, str] = field(default_factory=dict)
    stated: frozenset[str] = frozenset()

    @property
    def repaired_share(self) -> float:
        """Share of the rows that were left out, repeats aside, or in which a value was put in."""
        return (self.left_out - self.repeats + self.repaired) / max(self.rows_read, 1)

    @property
    def line(self) -> str:
        """All of it in one line."""
        parts = [f"{self.rows} rows every {self.interval_s:.4g} s", ", ".join(map(self._column, self._roles))]
        for number, what in ((self.left_out, "left out"), (self.repaired, "repaired")):
            if number:
                parts.append(f"{number} row{'s' if number > 1 else ''} {what}")
        if self.unused:
            more = f" and {len(self.unused) - _SHOWN} more" if len(self.unused) > _SHOWN else ""
            parts.append(f"not used: {', '.join(map(repr, self.unused[:_SHOWN]))}{more}")
        return f"{self.file}: {'; '.join(parts)}"

    def unit_option(self, role: str) -> str:
        """Return the option that states the unit of a column as it was read: of time, temperature or power."""
        name = UNIT_OPTIONS[role]
        value = self.reading.get(name, "s")
        return f"--{name.replace('_', '-')} {f'{value:g}' if isinstance(value, float) else value}"

    @property
    def _roles(self) -> tuple[str, ...]:
        return (*_ROLES, _NAMED) if _NAMED in self.columns else _ROLES

    def _column(self, role: str) -> str:
        if role not in self.columns:
            return f"{role} = none"
        name, written = self.columns[role]
        return f"{role} = {name}" + (f" [{written}]" if written else "")

    def document(self) -> dict[str, Any]:
        """Return it as a JSON document holds it."""
        return {
            "line": self.line, "rows": self.rows, "interval_s": self.interval_s,
            "columns": {role: {"name": name, "written": written} for role, (name, written) in self.columns.items()},
            "rows_read": self.rows_read, "left_out": self.left_out, "repeats": self.repeats,
            "repaired": self.repaired, "repaired_share": self.repaired_share, "unused": list(self.unused),
            "reading": dict(self.reading),
        }
