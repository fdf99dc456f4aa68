"""The commands that only read running loops: `record`, `watch` and `health`."""

from __future__ import annotations

import argparse
import shlex
import signal
import sys
import threading
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from datetime import UTC, datetime
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from heatertune import chain, options, report
from heatertune.batch.command import Bar, add_table_options, workers
from heatertune.cli import common, printing
from heatertune.cli.printing import LINE, can_take
from heatertune.codec import holds_zones
from heatertune.errors import HeatertuneError, InputError
from heatertune.live.client.connection import Address, address_of
from heatertune.settings import ReadSettings, WordSettings
from heatertune.writing import write_files

if TYPE_CHECKING:
    from heatertune.live.controller_block import Places
    from heatertune.live.joint.zone_blocks import ZonesPlaces
    from heatertune.live.loop_watch import BandWatch, OnlineMonitor, WatchStats
    from heatertune.live.recorder import RecordingState
    from heatertune.live.write.proven_words import ProvenWords

__all__ = [
    "ALL_SIGNALS", "HEALTH_EXAMPLE", "RECORD_EXAMPLE", "WATCH_EXAMPLE", "add_health", "add_record", "add_watch",
    "add_zone_blocks", "end_requests", "live_line", "show_notes", "signals_as_ctrl_c", "tell", "tell_unended",
    "unmoved_note", "zones_of",
]


RECORD_EXAMPLE: Final = "example: heatertune record s7://192.168.0.10/0/2/db30 --design out/ -o log.csv"


def add_record(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "record", help="running loop → a log for fit; the PLC is only read", epilog=RECORD_EXAMPLE,
        description="Read temperature, power and setpoint of a running controller, scan by scan, into a CSV file. Each "
                    "row is on disk before the next one; an incomplete last row is recognised. Stop with Ctrl-C.",
    )
    command.add_argument("address", metavar="ADDRESS", help="s7://HOST:PORT/RACK/SLOT/dbN, s7://HOST/10.00/10.01/db1 "
                         "(TSAPs of an S7-200), modbus://HOST:PORT/UNIT/REGISTER, opc.tcp://HOST:PORT/NODE, "
                         "as511://DEVICE/dbN or mqtt://USER@HOST:PORT")
    command.add_argument("-o", "--out", required=True, metavar="FILE", help="the log to write")
    where = command.add_mutually_exclusive_group()
    where.add_argument("--design", metavar="DIR",
                       help="folder that heatertune design wrote, of the controller at this address")
    where.add_argument("--map", metavar="FILE", help="small TOML file with the addresses of temperature and "
                       "power, or their MQTT topics")
    command.add_argument("--interval", type=float, metavar="S",
                         help="shortest interval between two rows (default: each scan if the PLC counts them, else 1 "
                              "s)")
    command.add_argument("--duration", dest="for_s", type=float, metavar="S", help="stop after this duration")
    command.add_argument("--append", action="store_true", help="continue an existing log")
    command.add_argument("--service", action="store_true",
                         help="run as a service: continue an existing log, and reopen it on SIGHUP (log rotation)")
    command.add_argument("--timeout", type=float, default=2.0, metavar="S",
                         help="time after which an answer counts as lost (default: 2)")
    add_zone_blocks(command)
    printing.add_output_options(command, _run_record)


def add_zone_blocks(command: argparse.ArgumentParser) -> None:
    """Add the option that says where the blocks of several zones are."""
    command.add_argument("--zone-blocks", metavar="N,N", help=(
        "of a design of zones: number of each zone's data block, or its first register (default: from that of the "
        "address, each 10 blocks or 100 registers further)"))


def zones_of(design: str | None, address: Address, numbers: str | None) -> ZonesPlaces | None:
    """Return where the zones of a design are; None: its folder holds a design of one heater, or there is none.

    Raises:
        InputError: numbers that are none, or as `heatertune.live.joint.zone_blocks.zones_places`.
    """
    if not holds_zones(design):
        if numbers is not None:
            raise InputError("--zone-blocks: only for a folder that design --zones wrote (--design)")
        return None
    try:
        blocks = [] if numbers is None else [int(part) for part in numbers.split(",")]
    except ValueError:
        raise InputError(f"--zone-blocks {numbers}: expected whole numbers with commas between them, such as "
                         "100,110") from None
    places: ZonesPlaces = import_module("heatertune.live.joint.zone_blocks").zones_places(design, address, blocks)
    return places


def _run_record(settings: argparse.Namespace) -> int:
    from heatertune.live.recorder import RecordingSetup, record

    address = address_of(settings.address)
    how = RecordingSetup(every_s=settings.interval, for_s=settings.for_s, append=settings.append or settings.service,
                         timeout_s=settings.timeout, pwm_period_s=_pwm_period_s(settings.design))
    places, start_s = _places(settings, address), time.monotonic()
    tell_unended(address)
    shown_notes: list[str] = []
    signals = [name for name in _ENDING if not (settings.service and name == "SIGHUP")]
    with end_requests(signals) as requests, end_requests(("SIGHUP",) if settings.service else ()) as hang_ups:
        def shown(so_far: RecordingState) -> None:
            show_notes(so_far, shown_notes)
            if not settings.quiet:
                LINE.show(lambda: f"{live_line(so_far, time.monotonic() - start_s)}; Ctrl-C ends it")

        so_far = record(address, settings.out, places, how, shown=shown, ended=lambda: bool(requests),
                        reopen=lambda: hang_ups.pop() > 0 if hang_ups else False)
    LINE.end()
    document = _document(settings, so_far) | {"zones": list(getattr(places, "zones", ())) or None}
    printing.output(settings, document, lambda: _lines(document))
    return 1 if so_far.notes else 0


def _places(settings: argparse.Namespace, address: Address) -> Places | ZonesPlaces | None:
    """Return where the PLC shows what is recorded, of one heater or of several zones."""
    from heatertune.live.controller_block import places_from

    return zones_of(settings.design, address, settings.zone_blocks) or places_from(
        design=settings.design, map_file=settings.map)


def tell_unended(address: Address) -> None:
    """Show on stderr what has not ended on a PLC."""
    from heatertune.live.hold import Hold

    if unended := Hold(address).message():
        tell(unended)


def show_notes(so_far: RecordingState, shown: list[str]) -> None:
    """Show on stderr, once, what others have done to the log."""
    for note in so_far.notes[len(shown):]:
        tell(note)
        shown.append(note)


def tell(message: str) -> None:
    """Show a message that stays on stderr, where that neither waits nor fails: what is under way goes on."""
    LINE.end()
    if can_take(sys.stderr):
        with suppress(OSError):
            print(message, file=sys.stderr, flush=True)


def _pwm_period_s(design: str | None) -> float | None:
    if design is None:
        return None
    if holds_zones(design):
        period: float = import_module("heatertune.zones.zones_folder").read_zones_design(design).pwm_period_s
        return period
    from heatertune.proof.words_file import pwm_period_in

    return pwm_period_in(design)


#: signals that end what can be ended at any time: Ctrl-C, a service manager, a terminal that is closed
_ENDING: Final = ("SIGINT", "SIGTERM", "SIGHUP")
#: all that would end or stop a program that has left a controller in manual, as far as a program can catch them
ALL_SIGNALS: Final = (*_ENDING, "SIGQUIT", "SIGBREAK", "SIGTSTP", "SIGUSR1", "SIGUSR2", "SIGALRM", "SIGVTALRM",
                      "SIGPROF", "SIGIO", "SIGPWR", "SIGSTKFLT", "SIGXCPU")
#: would stop a program in the background that writes to its terminal, or reads from it
_IGNORED: Final = ("SIGTTOU", "SIGTTIN")


@contextmanager
def end_requests(signals: Sequence[str] = _ENDING) -> Iterator[list[int]]:
    """Give a list that is filled when somebody asks for the end.

    What the caller of this program has it ignore, as `nohup` does with SIGHUP, stays ignored, but for Ctrl-C and
    SIGTERM.

    Args:
        signals: names of those that ask for it; a system does not have them all.
    """
    requests: list[int] = []
    before: dict[int, Any] = {}
    for name in signals:
        number = getattr(signal, name, None)
        if number is not None and (name in ("SIGINT", "SIGTERM") or signal.getsignal(number) is not signal.SIG_IGN):
            before[number] = signal.signal(number, lambda number, _: requests.append(number))
    if signals is ALL_SIGNALS:
        before |= {number: signal.signal(number, signal.SIG_IGN) for name in _IGNORED
                   if (number := getattr(signal, name, None)) is not None}
    try:
        yield requests
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


@contextmanager
def signals_as_ctrl_c() -> Iterator[None]:
    """Have SIGTERM and SIGHUP interrupt as Ctrl-C does, but for those that the caller of this program has it ignore."""

    def interrupt(_number: int, _frame: Any) -> None:
        raise KeyboardInterrupt

    before: dict[int, Any] = {}
    if threading.current_thread() is threading.main_thread():
        for name in _ENDING:
            number = getattr(signal, name, None)
            if number is not None and signal.getsignal(number) is not signal.SIG_IGN:
                before[number] = signal.signal(number, interrupt)
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def live_line(so_far: RecordingState, wall_s: float, hand: str = "") -> str:
    """Return the current readings, on one line of a terminal.

    Args:
        so_far: recorded.
        wall_s: since the beginning, by this machine's clock [s].
        hand: what is done to the controller, a few words.
    """
    if so_far.trouble:
        return f"{so_far.rows} rows; no answer, trying again: {so_far.trouble}"[:60]
    if so_far.last is None:
        return f"waiting for the first scan, {wall_s:.0f} s"
    signals = so_far.last.signals
    warm = [f"{degC:.2f}" for key, degC in signals.items() if key.endswith("temperature")]
    parts = [f"{so_far.last.time_s:.0f} s", f"{' '.join(warm)} °C"]
    parts += [f"{signals['power']:.1f} %"] if "power" in signals else []
    parts += [hand] if hand else [f"setpoint {signals['setpoint']:.1f} °C"] if "setpoint" in signals else []
    return f"{so_far.rows} rows: {', '.join(parts)}"[:60]


def _document(settings: argparse.Namespace, so_far: RecordingState) -> dict[str, Any]:
    return {
        "schema": "heatertune/record/1", "address": settings.address, "log": settings.out, "rows": so_far.rows,
        "until_s": None if so_far.last is None else so_far.last.time_s,
        "clock": "this machine" if so_far.interval_s is None else "scans of the PLC", "interval_s": so_far.interval_s,
        "gaps": so_far.gaps, "notes": so_far.notes, "torn_looks": so_far.torn,
        "last": None if so_far.last is None else dict(so_far.last.signals),
    }


def _lines(document: Mapping[str, Any]) -> str:
    log, rows = document["log"], document["rows"]
    if not rows:
        return f"{log}: nothing was recorded"
    clock = ("time is this machine's clock" if document["interval_s"] is None
             else f"time is the PLC's own count of scans, each {document['interval_s']:.6g} s")
    lines = [f"{log}: {rows} rows, until {document['until_s']:.6g} s; {clock}"]
    if document["gaps"]:
        lines.append(f"- {document['gaps']} times without readings: each is a comment in the log")
    lines += [f"- {note}" for note in document["notes"]]
    if document["torn_looks"]:
        lines.append(f"- {document['torn_looks']} looks that a scan fell into were left out")
    further = f"read {Path(log)}" if document["zones"] is None else (
        f"design {Path(log)} --zones {shlex.quote(','.join(document['zones']))}")
    return "\n".join([*lines, f"next: heatertune {further}"])


WATCH_EXAMPLE: Final = "example: heatertune watch s7://192.168.0.10/0/2/db30 --design out/"
_SHOWN: Final = 6
_NOT_JUDGED: Final = "NOT JUDGED"


def add_watch(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "watch", help="compare a running loop with its proven band: outside, oscillating, drifting",
        epilog=WATCH_EXAMPLE,
        description="Compare a running loop, scan by scan, with its proof; report if it leaves the band, oscillates, "
                    "or needs another power than at first. It only reads. Stop with Ctrl-C.",
    )
    command.add_argument("address", metavar="ADDRESS", help="as for heatertune record")
    command.add_argument("--design", metavar="DIR", required=True,
                         help="folder with the parameters that run there, and their proof")
    command.add_argument("-o", "--out", metavar="FILE", help="the log (default: DIR/watch_TIME.csv)")
    command.add_argument("--duration", dest="for_s", type=float, metavar="S",
                         help="stop after this duration (default: never)")
    command.add_argument("--append", action="store_true", help="continue an existing log")
    command.add_argument("--refit", action="store_true", help="identify the heater from the recorded log at the end")
    command.add_argument("--monitor", metavar="FILE", help=(
        "supervision.json by heatertune supervise: its monitor runs alongside; it does not replace a thermal cut-out"))
    add_zone_blocks(command)
    printing.add_output_options(command, _run_watch)


def _run_watch(settings: argparse.Namespace) -> int:
    from heatertune.live.controller_block import places_of
    from heatertune.live.hold import Hold
    from heatertune.live.loop_watch import BandWatch, others_there
    from heatertune.live.recorder import RecordingSetup, record
    from heatertune.live.write.proven_words import read_proven

    address = address_of(settings.address)
    if zones_of(settings.design, address, settings.zone_blocks) is not None:
        return _watch_zones(settings, address)
    proven = read_proven(settings.design, printing.Progress(settings))
    places = places_of(proven.words)
    if places is None:
        raise InputError(f"{settings.design}: where {proven.words.target} shows its temperature is not known here")
    log = Path(settings.out or Path(settings.design) / f"watch_{datetime.now(UTC):%Y%m%d_%H%M%S}.csv")
    band_watch, monitored = BandWatch(proven), _monitored(settings.monitor, proven)
    others, unknown = others_there(proven, address)
    unended = Hold(address).message()
    with end_requests() as requests:
        so_far = record(address, log, places, RecordingSetup(
            every_s=None if monitored is None else min(1.0, 0.5 * monitored.view.scan_s), for_s=settings.for_s,
            append=settings.append, pwm_period_s=proven.view.actuator.pwm_period_s),
            shown=_shown(settings, band_watch, monitored), ended=lambda: bool(requests))
    LINE.end()
    if not others:  # somebody may have written some meanwhile
        others, unknown = others_there(proven, address)
    unmoved = unmoved_note(band_watch.seen, band_watch.window_s, so_far)
    well = band_watch.seen.well and not unmoved
    unended = unended or Hold(address).message()  # one may have begun meanwhile
    well = well and not others and (monitored is None or not monitored.messages()) and not so_far.trouble
    well = well and not unended
    content = band_watch.seen.to_document()
    content["messages"] = [*(line for line in (unended, others, unmoved) if line), *content["messages"]]
    document = {"schema": "heatertune/watch/2", "address": address.text, "log": str(log), "rows": so_far.rows,
                "gaps": so_far.gaps, "lost": so_far.trouble or None, "well": well,
                "words_not_compared": unknown or None, **content,
                "monitor": None if monitored is None else monitored.to_document(),
                "refit": _refitted(log, proven) if settings.refit else None}
    printing.output(settings, document, lambda: _lines_watch(document))
    return 0 if well else 1


def _watch_zones(settings: argparse.Namespace, address: Address) -> int:
    """Run the command for zones; return its exit status."""
    if settings.refit:
        raise InputError("--refit: not for zones; leave it out, and design the recorded log again with the command "
                         "that the last line of watch names")
    if settings.monitor:
        raise InputError("--monitor: not for zones, whose watch has no monitor of each heater; leave it out: it "
                         "reports swings, fast rises, frozen sensors and another power at rest without one")
    return int(import_module("heatertune.live.commands.zone_commands").watch(settings, address))


def unmoved_note(stats: WatchStats, window_s: float, so_far: RecordingState) -> str:
    """Return that nothing is known, as nothing that was read has changed and no counter says that it is new.

    Args:
        stats: of the watch.
        window_s: how long a response takes [s].
        so_far: recorded.
    """
    if so_far.interval_s is not None or so_far.tells_new or stats.readings == 0:
        return ""
    if stats.still_s < min(stats.seconds, window_s):
        return ""
    return (f"{_NOT_JUDGED}: nothing that was read has changed for {stats.still_s:.4g} s, and no counter is read: a "
            "CPU that stands, a frozen sensor and a loop at rest look the same. Watch for longer")


def _monitored(path: str | None, proven: ProvenWords) -> OnlineMonitor | None:
    from heatertune.live.loop_watch import OnlineMonitor
    from heatertune.supervision.monitor_design import read_supervision

    if path is None:
        return None
    view = read_supervision(path)
    try:
        return OnlineMonitor(view, proven.words)
    except InputError as problem:
        raise InputError(f"--monitor {path}: {problem}") from None


def _shown(
    settings: argparse.Namespace, watch: BandWatch, monitored: OnlineMonitor | None
) -> Callable[[RecordingState], object]:
    start_s, last = time.monotonic(), [0]
    shown_notes: list[str] = []

    def shown(so_far: RecordingState) -> None:
        show_notes(so_far, shown_notes)
        if so_far.last is not None and so_far.rows > last[0]:
            last[0] = so_far.rows
            watch.see(so_far.last)
            if monitored is not None:
                monitored.see(so_far.last)
        if not settings.quiet:
            figures = watch.seen
            band = "" if figures.band is None else f"; proven {figures.band[0]:.4g}…{figures.band[1]:.4g} °C"
            messages = (*figures.notes(), *(() if monitored is None else monitored.messages()))
            alarm = f" NOT WELL: {messages[-1]}" if messages else ""
            LINE.show(lambda: f"{live_line(so_far, time.monotonic() - start_s)}{band}{alarm}"[:118])

    return shown


def _refitted(log: Path, proven: ProvenWords) -> dict[str, Any]:
    """Return each parameter as it is now, beside what the proof was made on."""
    try:
        fitted = chain.fit(log)
    except HeatertuneError as problem:
        return {"message": f"the log does not tell the heater: {problem}"}
    table = {}
    for name in ("gain_degC_per_pct", "time_constant_s", "dead_time_s", "ambient_degC"):
        now, interval = getattr(fitted.model, name), fitted.ci95.get(name)
        was = getattr(proven.fitted_model.model, name)
        apart = interval is not None and (
            (interval.low is not None and was < interval.low) or (interval.high is not None and was > interval.high))
        table[name] = {"was": was, "now": now, "low": interval and interval.low, "high": interval and interval.high,
                       "moved": apart}
    return {"message": fitted.outcome_text, "parameters": table}


def _lines_watch(document: Mapping[str, Any]) -> str:
    if not document["readings"] and not document["unusable"]:
        why = f"; {document['messages'][0]}" if document["messages"] else ""
        return f"{document['log']}: nothing was seen{why}"
    judged = not (len(document["messages"]) == 1 and document["messages"][0].startswith(_NOT_JUDGED))
    head = ("WELL: inside the proven band" if document["well"] else "NOT WELL" if judged else _NOT_JUDGED) + (
        f", {document['readings']} readings; at most {100.0 * document['largest_share_of_band']:.0f} % of the band") + (
        f"; {document['gaps']} gap{'s' if document['gaps'] > 1 else ''} in the log" if document["gaps"] else "")
    lost = [f"- the link was lost and is not back: {document['lost']}"] if document["lost"] else []
    unknown = document["words_not_compared"]
    open_ = [f"- whether the words there are the proven ones is not known: {unknown}"] if unknown else []
    lines = [head, *lost, *open_, *(f"- {each}" for each in document["messages"][:_SHOWN])]
    if len(document["messages"]) > _SHOWN:
        lines.append(f"- and {len(document['messages']) - _SHOWN} more: --json")
    monitor = document["monitor"]
    if monitor is not None:
        missed = (f"{monitor['missed']} missed, begun anew {monitor['begun_anew']} times, "
                  f"blind for {100.0 * monitor['blind_share']:.0f} % of the time")
        lines += [*monitor["messages"], f"monitor: {monitor['scans']} scans, {missed}; it replaces no thermal cut-out"]
    refit = document["refit"]
    if refit is not None:
        lines.append(f"refit: {refit['message']}")
        for name, each in refit.get("parameters", {}).items():
            interval = "not known" if each["low"] is None or each["high"] is None else (
                f"{each['low']:.4g} … {each['high']:.4g}")
            lines.append(f"  {name}: {each['now']:.4g} (95 %: {interval}); was {each['was']:.4g}"
                         f"{': MOVED' if each['moved'] else ''}")
    return "\n".join([*lines, f"next: heatertune read {document['log']}"])


HEALTH_EXAMPLE: Final = "example: heatertune health logs/ --target s7-300 -o health.html"


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
