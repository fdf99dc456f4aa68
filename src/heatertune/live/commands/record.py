"""`heatertune record`: a running loop → a log, read only."""

from __future__ import annotations

import argparse
import signal
import sys
import threading
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager, suppress
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from heatertune.cli import printing
from heatertune.cli.printing import LINE, can_take
from heatertune.live.client.address import address_of

if TYPE_CHECKING:
    from heatertune.live.recorder import RecordingState

__all__ = ["ALL_SIGNALS", "add_to", "asked_to_end", "live_line", "show_notes", "signals_as_ctrl_c", "tell"]

_EXAMPLE: Final = "example: heatertune record s7://192.168.0.10/0/2/db30 --design out/ -o log.csv"


def add_to(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "record", help="running loop → a log for fit; the PLC is only read", epilog=_EXAMPLE,
        description="Read temperature, power and setpoint of a running controller, scan by scan, into a CSV file. Each "
                    "row is on disk before the next one; an incomplete last row is recognised. Stop with Ctrl-C.",
    )
    command.add_argument("address", metavar="ADDRESS", help="s7://HOST:PORT/RACK/SLOT/dbN, s7://HOST/10.00/10.01/db1 "
                         "(TSAPs of an S7-200), modbus://HOST:PORT/UNIT/REGISTER, opc.tcp://HOST:PORT/NODE or "
                         "as511://DEVICE/dbN")
    command.add_argument("-o", "--out", required=True, metavar="FILE", help="the log to write")
    where = command.add_mutually_exclusive_group()
    where.add_argument("--design", metavar="DIR",
                       help="folder that heatertune design wrote, of the controller at this address")
    where.add_argument("--map", metavar="FILE", help="small TOML file with the addresses of temperature and power")
    command.add_argument("--every", type=float, metavar="S",
                         help="shortest interval between two rows (default: each scan if the PLC counts them, else 1 "
                              "s)")
    command.add_argument("--for", dest="for_s", type=float, metavar="S", help="stop after this duration")
    command.add_argument("--append", action="store_true", help="continue an existing log")
    command.add_argument("--timeout", type=float, default=2.0, metavar="S",
                         help="time after which an answer counts as lost (default: 2)")
    printing.add_output_options(command)
    command.set_defaults(run=_run)


def _run(settings: argparse.Namespace) -> int:
    from heatertune.live.recorder import RecordingSetup, record  # noqa: PLC0415 - the help must not wait for it
    from heatertune.live.signal_map import places_given  # noqa: PLC0415

    address = address_of(settings.address)
    how = RecordingSetup(every_s=settings.every, for_s=settings.for_s, append=settings.append,
                         timeout_s=settings.timeout,
                    pwm_period_s=_pwm_period_s(settings.design))
    places, begun = places_given(design=settings.design, map_file=settings.map), time.monotonic()
    shown_notes: list[str] = []
    with asked_to_end() as asked:
        def shown(so_far: RecordingState) -> None:
            show_notes(so_far, shown_notes)
            if not settings.quiet:
                LINE.show(lambda: f"{live_line(so_far, time.monotonic() - begun)}; Ctrl-C ends it")

        so_far = record(address, settings.out, places, how, shown=shown, ended=lambda: bool(asked))
    LINE.end()
    document = _document(settings, so_far)
    printing.output(settings, document, lambda: _lines(document))
    return 1 if so_far.notes else 0


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
    from heatertune.proof.words_file import pwm_period_in  # noqa: PLC0415 - who gives a map needs no proof's code

    return pwm_period_in(design)


#: signals that end what can be ended at any time: Ctrl-C, a service manager, a terminal that is closed
_ENDING: Final = ("SIGINT", "SIGTERM", "SIGHUP")
#: all that would end or stop a program that has left a controller in manual, as far as a program can catch them
ALL_SIGNALS: Final = (*_ENDING, "SIGQUIT", "SIGBREAK", "SIGTSTP", "SIGUSR1", "SIGUSR2", "SIGALRM", "SIGVTALRM",
                      "SIGPROF", "SIGIO", "SIGPWR", "SIGSTKFLT", "SIGXCPU")
#: would stop a program in the background that writes to its terminal, or reads from it
_IGNORED: Final = ("SIGTTOU", "SIGTTIN")


@contextmanager
def asked_to_end(signals: Sequence[str] = _ENDING) -> Iterator[list[int]]:
    """Give a list that is filled when somebody asks for the end.

    What the caller of this program has it ignore, as `nohup` does with SIGHUP, stays ignored, but for Ctrl-C and
    SIGTERM.

    Args:
        signals: names of those that ask for it; a system does not have them all.
    """
    asked: list[int] = []
    before: dict[int, Any] = {}
    for name in signals:
        number = getattr(signal, name, None)
        if number is not None and (name in ("SIGINT", "SIGTERM") or signal.getsignal(number) is not signal.SIG_IGN):
            before[number] = signal.signal(number, lambda number, _: asked.append(number))
    if signals is not _ENDING:
        before |= {number: signal.signal(number, signal.SIG_IGN) for name in _IGNORED
                   if (number := getattr(signal, name, None)) is not None}
    try:
        yield asked
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
    """Return what is recorded just now, on one line of a terminal.

    Args:
        so_far: recorded.
        wall_s: since the beginning, by this machine's clock [s].
        hand: what is done to the controller, a few words.
    """
    if so_far.trouble:
        return f"{so_far.rows} rows; no answer, trying again: {so_far.trouble}"[:60]
    if so_far.last is None:
        return f"waiting for the first scan, {wall_s:.0f} s"
    seen = so_far.last.signals
    parts = [f"{so_far.last.time_s:.0f} s", f"{seen['temperature']:.2f} °C"]
    parts += [f"{seen['power']:.1f} %"] if "power" in seen else []
    parts += [hand] if hand else [f"setpoint {seen['setpoint']:.1f} °C"] if "setpoint" in seen else []
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
    return "\n".join([*lines, f"next: heatertune read {Path(log)}"])
