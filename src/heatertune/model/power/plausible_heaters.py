"""The family of plausible heaters of a log with power: the candidates, the ends of their intervals, and the halves."""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from typing import TYPE_CHECKING, Final, NamedTuple

from heatertune.model.check_results import Half
from heatertune.model.findings import Finding
from heatertune.model.intervals import RATIO, Interval
from heatertune.model.power.interval_ends import ends_of, halves_of, held_by, told_apart
from heatertune.model.power.uncertainty import intervals_by
from heatertune.model.values import Candidate

if TYPE_CHECKING:
    from heatertune.model.power.explanation import Explanation

__all__ = ["family_of", "open_ends"]

_NEAR: Final = 10.0  # BIC points


class _Order(NamedTuple):
    """One lag or two: its place in problems and fits, its candidate and its intervals."""

    place: int
    candidate: Candidate
    ci95: Mapping[str, Interval | None]


def family_of(
    explanation: Explanation, candidates: Sequence[Candidate], ci95: Mapping[str, Interval | None],
    halves: tuple[Half, Half] | None, least_dead_time_s: float, wider: Mapping[str, float], seed: int,
) -> tuple[tuple[Candidate, ...], tuple[Finding, ...]]:
    """Return every plausible heater, and what is open that no heater can stand for.

    Args:
        explanation: what explains the log.
        candidates: the hypotheses that explain it, one lag first.
        ci95: intervals of one lag, gain per time constant and ultimate period among them.
        halves: one lag fitted to each half, None where that could not be done.
        least_dead_time_s: no dead time below this is believed.
        wider: factors by which the halves ask for wider intervals, see `parts.widening`; taken for two lags too.
        seed: of the bootstrap of two lags.
    """
    orders = list(_orders(explanation, candidates, ci95, wider, seed))
    ends: list[Candidate] = []
    for order in orders:
        values, held = held_by(explanation.problems[order.place], explanation.fits[order.place])
        ends += ends_of(order.candidate, values, order.ci95, held, least_dead_time_s=least_dead_time_s)
    parts = () if halves is None else halves_of(explanation.log, halves, law=candidates[0].law)
    return told_apart([*candidates, *ends, *parts], least_dead_time_s), tuple(
        open_ends([("two lags" if order.place else "one lag", order.ci95) for order in orders]))


def _orders(
    explanation: Explanation, candidates: Sequence[Candidate], ci95: Mapping[str, Interval | None],
    wider: Mapping[str, float], seed: int,
) -> Iterator[_Order]:
    """Return one lag and two, as far as they explain the log.

    Where two lags explain it far better, of one lag the dead time alone stays: its interval is what is told.
    """
    one, *others = candidates
    two = next((other for other in others if len(other.model.lags_s) > 1 and other.law == one.law), None)
    better = two is not None and one.delta_bic >= two.delta_bic + _NEAR
    yield _Order(0, one, {"dead_time_s": ci95["dead_time_s"]} if better else ci95)
    if two is not None:
        yield _Order(1, two, intervals_by(explanation.problems[1], explanation.fits[1], [wider], seed=seed)[0])


def open_ends(orders: Sequence[tuple[str, Mapping[str, Interval | None]]]) -> Iterator[Finding]:
    """Tell which upper ends are open: beyond them lie heaters on which nothing was proven.

    `orders`: number of lags in words, and the intervals with it.
    """
    for name, finding, what in (
        ("dead_time_s", "dead-time-open", "dead time has no upper end"),
        (RATIO, "faster-than-log", "gain per time constant has no upper end"),
    ):
        open_ = [lags for lags, ci95 in orders if (end := ci95.get(name)) is not None and end.high is None]
        if open_:
            yield Finding(name=finding, message=f"With {open_[0]}, the {what} within the log.")
