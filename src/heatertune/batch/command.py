"""The commands that write one table of many cases, `fleet` and `study`, and options shared with `health`."""

from __future__ import annotations

import argparse
import sys
import time
from typing import TYPE_CHECKING, Any, Final

from heatertune import options, report
from heatertune.cli import common, printing
from heatertune.errors import InputError
from heatertune.settings import FitSettings, SampleSettings, WordSettings

if TYPE_CHECKING:
    from heatertune.batch import Workers

__all__ = ["FLEET_EXAMPLE", "STUDY_EXAMPLE", "Bar", "add_fleet", "add_study", "add_table_options", "workers"]


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
    from heatertune.batch import in_processes, on_dask

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


FLEET_EXAMPLE = "example: heatertune fleet logs/ --target s7-300 -o fleet.parquet"


def add_fleet(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "fleet", help="many logs → one table: each fitted, tuned, rounded and proven", epilog=FLEET_EXAMPLE,
        description="Run the chain on the log of every zone of a plant and write one row per log. A log that cannot be "
                    "read, fitted or proven gets a row with the reason. Exits 0 once the table is written, whatever "
                    "its verdicts, and 2 if no log can be read.",
    )
    command.add_argument("logs", metavar="LOGS", help="a folder, a quoted pattern, or a list of paths")
    add_table_options(command)
    options.add(command, SampleSettings, "samples",
                help="also prove each zone on N sampled heaters; see: design --samples")
    options.add(command, WordSettings, "words_by", "as_is")
    common.add_proof_options(command)
    common.add_log_options(command)
    common.add_tuning_options(command)
    printing.add_output_options(command, _run_fleet)


def _run_fleet(settings: argparse.Namespace) -> int:
    from heatertune.batch.fleets import ZoneSettings, fleet

    zones = ZoneSettings(request=common.design_request(settings), read=common.reading(settings),
                         fitted_with=options.of(FitSettings, settings))
    document = fleet(settings.logs, zones, out=settings.out, workers=workers(settings), resume=settings.resume,
                     progress=Bar(settings, "zones"))
    printing.output(settings, document, lambda: report.outcome_lines(document))
    if set(document["outcomes"]) == {"no log"}:
        raise InputError(f"{settings.logs}: no log that can be read; {document['table']} has the reason of each")
    return 0


STUDY_EXAMPLE = """\
example: heatertune study study.toml -o study.parquet

study.toml:
  [fixed]                                  # the same in every case
  log = "table4"                           # or model = "model.json", or gain_degC_per_pct, time_constant_s, …
  setpoint_degC = 53.3
  [grid]                                   # every combination is a case
  target = ["s5-ob251", "s7-300"]
  ms = [1.4, 1.6, 2.0]
  [[case]]                                 # one further case
  target = "s7-200"
  switches = { rails = "edges_go_on" }
"""


def add_study(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "study", help="a sweep over targets, settings and heaters → one table", epilog=STUDY_EXAMPLE,
        formatter_class=argparse.RawDescriptionHelpFormatter,
        description="Run the chain on every case of a study and write one row per case. A case that cannot be run\n"
        "gets a row with the reason. Exits 0 once the table is written, whatever its verdicts.",
    )
    command.add_argument("study", metavar="STUDY.toml", help="the definition of the sweep")
    add_table_options(command)
    printing.add_output_options(command, _run_study)


def _run_study(settings: argparse.Namespace) -> int:
    from heatertune.batch.studies import study

    document = study(
        settings.study, out=settings.out, workers=workers(settings), resume=settings.resume,
        progress=Bar(settings, "cases"),
    )
    printing.output(settings, document, lambda: report.outcome_lines(document))
    return 0
