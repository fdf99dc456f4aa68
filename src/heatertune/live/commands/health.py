"""`heatertune health`: the logs of running loops → which are ill, why, and the words that would cure them."""

from __future__ import annotations

import argparse
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

from heatertune import options, report
from heatertune.batch.command import Bar, add_table_options, workers
from heatertune.cli import common, printing
from heatertune.cli.printing import LINE
from heatertune.errors import InputError
from heatertune.live.client.connection import address_of
from heatertune.live.commands.record_watch import end_requests, tell_unended
from heatertune.settings import ReadSettings, WordSettings
from heatertune.writing import write_files

__all__ = ["HEALTH_EXAMPLE", "add_health"]

HEALTH_EXAMPLE = "example: heatertune health logs/ --target s7-300 -o health.html"


def add_health(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "health", help="rank running loops by condition, with the cause and the parameters that would fix "
                       "it", epilog=HEALTH_EXAMPLE,
        description="Examine the log of every running loop: oscillation, slow recovery, limits, wear, drift, and the "
                    "distance from the best possible control of its heater. Writes one page, the worst loop first, "
                    "with proven parameters where these help, and a Parquet table. Exits 0 once the page is written, "
                    "whatever the condition of the loops.",
    )
    command.add_argument("logs", metavar="LOGS", nargs="+",
                         help="a folder, a quoted pattern, or a list of paths: one log per loop, with setpoint, "
                              "temperature and power; or addresses of running PLCs (as for record), which are only "
                              "read")
    command.add_argument("--loops", metavar="FILE",
                         help="CSV or TOML with what the logs do not contain: columns file, name, target, folder, "
                              "setpoint_degC, switch, pwm_period_s, low_degC, high_degC, map")
    command.add_argument("--duration", dest="for_s", type=float, metavar="S",
                         help="how long to record the loops at the addresses")
    command.add_argument("--interval", type=float, metavar="S", help="shortest interval between two rows of these logs")
    command.add_argument("--since", metavar="last|FILE", help="compare with the previous run; or with a Parquet table")
    common.add_proof_options(command, needed=False)
    options.add(command, WordSettings, "switch_kind", "as_is")
    options.add(command.add_argument_group("reading the logs"), ReadSettings)
    common.add_tuning_options(command)
    add_table_options(command, "the page; its table has the same name with .parquet")
    printing.add_output_options(command, _run_health)


def _run_health(settings: argparse.Namespace) -> int:
    from heatertune.batch.loop_health import HealthSettings, health, last_table

    page, settings.target = Path(settings.out), settings.target or ""  # each loop may name its own
    if page.suffix.lower() not in (".html", ".htm"):
        raise InputError(f"--out {page}: expected the name of a page, .html; its table gets the same name with "
                         ".parquet")
    table = page.with_suffix(".parquet")
    since = None if settings.since is None else last_table(table if settings.since == "last" else settings.since)
    options = HealthSettings(request=common.design_request(settings), read=common.reading(settings))
    logs, loops, left_out = _logs(settings, page)
    document = health(
        logs, options, out=table, workers=workers(settings), loops=loops, since=since, resume=settings.resume,
        progress=Bar(settings, "loops")) | {"page": str(page)}
    document["left_out"] += left_out
    write_files(page.parent, {page.name: report.loops_page(document)})
    printing.output(settings, document, lambda: report.loops_lines(document))
    return 0


def _logs(settings: argparse.Namespace, page: Path) -> tuple[str | Path, Any, list[dict[str, Any]]]:
    """Return where the logs are, what is known of their loops, and which loops have none; running ones are recorded."""
    from heatertune.live.recorder import (
        RecordingSetup,
        is_address,
        record_addresses,
    )

    addresses = [text for text in settings.logs if is_address(text)]
    if not addresses:
        if len(settings.logs) > 1:
            raise InputError(f"{settings.logs[1]}: give one folder, one pattern in quotation marks or one list; or "
                             "addresses")
        if settings.for_s is not None or settings.interval is not None:
            raise InputError("--duration and --interval apply to addresses, not to existing logs")
        return settings.logs[0], settings.loops, []
    if len(addresses) < len(settings.logs):
        raise InputError(f"{addresses[0]} is an address: give addresses alone, or logs alone")
    if settings.for_s is None:
        raise InputError("--duration S is needed: how long to record the loops, enough for a setpoint change or a load")
    if settings.resume:
        raise InputError(f"--resume continues with existing logs: give their folder in {page.stem}_logs")
    for text in addresses:
        tell_unended(address_of(text))
    folder = page.with_name(f"{page.stem}_logs") / f"{datetime.now(UTC):%Y%m%dT%H%M%SZ}"
    with end_requests() as requests:
        loops, left_out = record_addresses(
            addresses, folder, RecordingSetup(for_s=settings.for_s, every_s=settings.interval), loops=settings.loops,
            ended=lambda: bool(requests), shown=lambda rows: None if settings.quiet else LINE.show(
                lambda: f"{len(addresses)} loops, {rows} rows; Ctrl-C ends it"))
    LINE.end()
    return folder, loops, left_out
