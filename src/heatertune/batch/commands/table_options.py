"""What the commands that write one table of many cases share."""

from __future__ import annotations

import argparse
import sys
import time
from typing import TYPE_CHECKING, Final

from heatertune.errors import InputError

if TYPE_CHECKING:
    from heatertune.batch import Workers

__all__ = ["Bar", "add_table_options", "workers"]


_TABLE: Final = "Parquet table; FILE.parts next to it keeps finished rows until all are done"


def add_table_options(command: argparse.ArgumentParser, out: str = _TABLE) -> None:
    """Add the table, and who does the work; `out` says what is written."""
    group = command.add_argument_group("table and workers")
    group.add_argument("-o", "--out", metavar="FILE", required=True, help=out)
    group.add_argument("--resume", action="store_true", help="continue an interrupted run")
    group.add_argument("--jobs", type=int, metavar="N", help="processes on this machine (default: one per processor)")
    group.add_argument("--scheduler", metavar="tcp://HOST:PORT",
                       help="use a Dask cluster, whose workers need the same version of heatertune (extra: dask)")


def workers(settings: argparse.Namespace) -> Workers:
    """Return who does the work.

    Raises:
        InputError: both kinds are asked for; as `in_processes` and `on_dask`.
    """
    from heatertune.batch import in_processes, on_dask  # noqa: PLC0415 - the help must not wait for it

    if settings.scheduler is None:
        return in_processes(settings.jobs)
    if settings.jobs is not None:
        raise InputError("give --jobs or --scheduler, not both: the cluster knows its workers")
    return on_dask(settings.scheduler)


class Bar:
    """How far the cases are, their rate and the time left, on stderr; silent with --quiet.

    On a terminal one line that moves, elsewhere a line every ten seconds.
    """

    def __init__(self, settings: argparse.Namespace, noun: str) -> None:
        self._loud, self._noun = not settings.quiet, noun
        self._moving = sys.stderr.isatty()
        self._pause = 0.2 if self._moving else 10.0
        self._begun = time.monotonic()
        self._told: float | None = None
        self._before = 0  # cases that an earlier run had done: they say nothing about the rate

    def __call__(self, done: int, total: int) -> None:
        """Tell that so many cases of all are done."""
        now, last = time.monotonic(), done == total
        if self._told is None:
            self._before = done
        elif now - self._told < self._pause and not last:
            return
        self._told = now
        if not self._loud:
            return
        line = f"[{now - self._begun:5.1f} s] {done} of {total} {self._noun}{self._pace(done, total, now)}"
        print(f"\r{line:<78}" if self._moving else line, end="" if self._moving and not last else "\n",
              file=sys.stderr, flush=True)

    def _pace(self, done: int, total: int, now: float) -> str:
        fresh = done - self._before
        if fresh == 0:
            return ", done before" if done else ""
        rate = fresh / max(now - self._begun, 1e-9)
        return f", {rate:.3g}/s" + (f", {_duration((total - done) / rate)} left" if done < total else "")


def _duration(seconds: float) -> str:
    """Return a time as people say it: 42 s, 5.2 min, 3.1 h."""
    for unit, length in (("h", 3600.0), ("min", 60.0)):
        if seconds >= length:
            return f"{seconds / length:.1f} {unit}"
    return f"{seconds:.0f} s"
