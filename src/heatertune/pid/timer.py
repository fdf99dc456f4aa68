"""The sampling intervals that a controller's timer can make."""

from __future__ import annotations

from dataclasses import dataclass

__all__ = ["Timer"]


@dataclass(frozen=True, slots=True, kw_only=True)
class Timer:
    """What the target's timer can do: shortest, longest and step of the sampling interval [s]."""

    shortest_s: float = 0.01
    longest_s: float = 600.0
    step_s: float = 0.01

    def round(self, wanted_s: float) -> float:
        """Return a plain interval near the wanted one: whole seconds above 10 s, tenths above 1 s, else steps."""
        plain = 1.0 if wanted_s > 10.0 else 0.1 if wanted_s > 1.0 else self.step_s
        plain = max(plain, self.step_s)
        rounded = round(wanted_s / plain) * plain
        rounded = min(max(rounded, self.shortest_s), self.longest_s)
        return round(round(rounded / self.step_s) * self.step_s, 6)
