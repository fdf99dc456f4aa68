"""How much a search may simulate, counted in scans: the same request then has the same result on every machine.

Each run that a search asks for counts with all of its scans, also where its result is known already: what was simulated
earlier must not decide how far the search gets.
"""

from __future__ import annotations

from contextvars import ContextVar, Token
from dataclasses import dataclass, field
from types import TracebackType
from typing import Final

__all__ = ["MOST_SCANS", "SearchBudget", "count_scans"]

#: that a search simulates where nothing else is said: about a minute of a processor, several times what most take
MOST_SCANS: Final = 300e6
_MILLION: Final = 1e6


class BudgetSpent(Exception):
    """A search has simulated as much as it may; it ends within the budget that raises this."""


@dataclass(slots=True, kw_only=True, eq=False)
class SearchBudget:
    """A limit on what is simulated within a `with` block: beyond it the block ends, and the program goes on after it.

    A budget within another one is charged to both.

    Attributes:
        scans: that may be simulated.
        used: scans that were.
        spent: whether the block ended early.
    """

    scans: float = field(default_factory=lambda: MOST_SCANS)
    used: float = 0.0
    spent: bool = False
    _token: Token[tuple[SearchBudget, ...]] | None = field(default=None, init=False, repr=False)

    def __enter__(self) -> SearchBudget:
        self._token = _budgets.set((*_budgets.get(), self))
        return self

    def __exit__(
        self, kind: type[BaseException] | None, problem: BaseException | None, trace: TracebackType | None
    ) -> bool:
        if self._token is not None:
            _budgets.reset(self._token)
            self._token = None
        self.spent = isinstance(problem, BudgetSpent) and problem.args == (self,)
        return self.spent

    @property
    def message(self) -> str:
        """That it is spent, for a reader."""
        return f"the search ended after {self.scans / _MILLION:,g} million simulated scans, its budget"


_budgets: ContextVar[tuple[SearchBudget, ...]] = ContextVar("budgets", default=())


def count_scans(scans: float) -> None:
    """Charge scans to every budget that is open.

    Raises:
        BudgetSpent: one of them, the outermost first, is spent.
    """
    budgets = _budgets.get()
    for budget in budgets:
        budget.used += scans
    for budget in budgets:
        if budget.used > budget.scans:
            raise BudgetSpent(budget)
