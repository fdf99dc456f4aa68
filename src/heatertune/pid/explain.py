"""Why a design is what it is: the limits it stands at, and what each would give if it were loosened."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from contextvars import ContextVar

from heatertune.errors import InputError
from heatertune.pid.specs import Specs

__all__ = ["LOOSER", "explain", "without_explanation"]

LOOSER = 1.05  # factor by which a limit is loosened to see what it costs

_AT = 5e-3  # share of a limit within which it counts as reached
_NAMES = {"ms": "Ms", "mt": "Mt", "mks": "Mks"}

_left_out: ContextVar[bool] = ContextVar("left_out", default=False)


@contextmanager
def without_explanation() -> Iterator[None]:
    """Explain nothing within the block: a table has no place for it, and each limit takes a search of its own."""
    mark = _left_out.set(True)
    try:
        yield
    finally:
        _left_out.reset(mark)


def explain(
    specs: Specs, peaks: Mapping[str, float], cost: float, solve: Callable[[Specs], float], held: Sequence[str] = ()
) -> list[str]:
    """Return one sentence for each limit that is active, or one that says that none is; `unexplained`: none.

    Args:
        specs: objective and limits of the design.
        peaks: what the design has, name of the limit → value.
        cost: of the design.
        solve: specs → cost of the optimum under them; called once for each active limit.
        held: what else holds the gain, one sentence each.
    """
    if _left_out.get():
        return []
    active = [name for name, limit in specs.limits.items() if peaks[name] >= limit * (1.0 - _AT)]
    if not active and not held:
        return [f"No limit is active ({specs.text}): a larger gain would only make the response swing."]
    return [*held, *(_sentence(specs, name, cost, solve) for name in active)]


def _sentence(specs: Specs, name: str, cost: float, solve: Callable[[Specs], float]) -> str:
    limit, called = specs.limits[name], _NAMES[name]
    try:
        looser = specs.with_limit(name, limit * LOOSER)
    except InputError:  # beyond what a limit may be
        return f"{called} stands at its limit of {limit:g}, the largest there is."
    gained = 100.0 * (1.0 - solve(looser) / cost) if cost > 0.0 else 0.0
    worth = f"the cost would be {gained:.1f} % lower" if gained >= 0.05 else "nothing would be gained"
    return f"{called} stands at its limit of {limit:g}; with {called} <= {limit * LOOSER:.4g} {worth}."
