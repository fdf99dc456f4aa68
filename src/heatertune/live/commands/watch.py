"""`heatertune watch`: a running loop beside its proven band; it only looks."""

from __future__ import annotations

import argparse
import time
from collections.abc import Callable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from heatertune import chain
from heatertune.cli import printing
from heatertune.cli.printing import LINE
from heatertune.errors import HeatertuneError, InputError
from heatertune.live.client.address import address_of
from heatertune.live.commands.record import asked_to_end, live_line, show_notes

if TYPE_CHECKING:
    from heatertune.live.band_watch import BandWatch
    from heatertune.live.online_monitor import OnlineMonitor
    from heatertune.live.recorder import RecordingState
    from heatertune.live.write.proven_words import ProvenWords

__all__ = ["add_to"]

_EXAMPLE: Final = "example: heatertune watch s7://192.168.0.10/0/2/db30 --design out/"
_SHOWN: Final = 6
_NOT_JUDGED: Final = "NOT JUDGED"


def add_to(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "watch", help="compare a running loop with its proven band: outside, oscillating, drifting", epilog=_EXAMPLE,
        description="Compare a running loop, scan by scan, with its proof; report if it leaves the band, oscillates, "
                    "or needs another power than at first. It only reads. Stop with Ctrl-C.",
    )
    command.add_argument("address", metavar="ADDRESS", help="as for heatertune record")
    command.add_argument("--design", metavar="DIR", required=True,
                         help="folder with the parameters that run there, and their proof")
    command.add_argument("-o", "--out", metavar="FILE", help="the log (default: DIR/watch_TIME.csv)")
    command.add_argument("--for", dest="for_s", type=float, metavar="S",
                         help="stop after this duration (default: never)")
    command.add_argument("--append", action="store_true", help="continue an existing log")
    command.add_argument("--refit", action="store_true", help="identify the heater from the recorded log at the end")
    command.add_argument("--monitor", metavar="FILE", help=(
        "supervision.json by heatertune supervise: its monitor runs alongside; it does not replace a thermal cut-out"))
    printing.add_output_options(command)
    command.set_defaults(run=_run)


def _run(settings: argparse.Namespace) -> int:
    from heatertune.live.band_watch import BandWatch, others_there  # noqa: PLC0415
    from heatertune.live.plc_state import PlcState  # noqa: PLC0415
    from heatertune.live.recorder import RecordingSetup, record  # noqa: PLC0415
    from heatertune.live.signal_map import places_of  # noqa: PLC0415
    from heatertune.live.write.proven_words import read_proven  # noqa: PLC0415 - the help must not wait for it

    address, proven = address_of(settings.address), read_proven(settings.design, printing.Progress(settings))
    places = places_of(proven.words)
    if places is None:
        raise InputError(f"{settings.design}: where {proven.words.target} shows its temperature is not known here")
    log = Path(settings.out or Path(settings.design) / f"watch_{datetime.now(UTC):%Y%m%d_%H%M%S}.csv")
    beside, monitored = BandWatch(proven), _monitored(settings.monitor, proven)
    others, unknown = others_there(proven, address)
    open_experiment = PlcState(address).message()
    with asked_to_end() as asked:
        so_far = record(address, log, places, RecordingSetup(
            every_s=None if monitored is None else min(1.0, 0.5 * monitored.view.scan_s), for_s=settings.for_s,
            append=settings.append, pwm_period_s=proven.view.actuator.pwm_period_s),
            shown=_shown(settings, beside, monitored), ended=lambda: bool(asked))
    LINE.end()
    if not others:  # somebody may have written some meanwhile
        others, unknown = others_there(proven, address)
    unmoved = _unmoved(beside, so_far)
    well = beside.seen.readings > 0 and beside.seen.well and not unmoved  # who has seen nothing knows nothing
    open_experiment = open_experiment or PlcState(address).message()  # one may have begun meanwhile
    well = well and not others and (monitored is None or not monitored.messages()) and not so_far.trouble
    well = well and not open_experiment
    seen = beside.seen.to_document()
    seen["messages"] = [*(line for line in (open_experiment, others, unmoved) if line), *seen["messages"]]
    document = {"schema": "heatertune/watch/2", "address": address.text, "log": str(log), "rows": so_far.rows,
                "gaps": so_far.gaps, "lost": so_far.trouble or None, "well": well,
                "words_not_compared": unknown or None, **seen,
                "monitor": None if monitored is None else monitored.to_document(),
                "refit": _refitted(log, proven) if settings.refit else None}
    printing.output(settings, document, lambda: _lines(document))
    return 0 if well else 1


def _unmoved(beside: BandWatch, so_far: RecordingState) -> str:
    """Return that nothing is known, for nothing that was read has changed and no counter says that it is new."""
    seen = beside.seen
    if so_far.interval_s is not None or seen.readings == 0 or seen.still_s < min(seen.seconds, beside.window_s):
        return ""
    return (f"{_NOT_JUDGED}: nothing that was read has changed for {seen.still_s:.4g} s, and no counter is read: a CPU "
            "that stands, a frozen sensor and a loop at rest look the same. Watch for longer")


def _monitored(path: str | None, proven: ProvenWords) -> OnlineMonitor | None:
    from heatertune.live.online_monitor import OnlineMonitor  # noqa: PLC0415 - only where it is asked for
    from heatertune.supervision.document import read_supervision  # noqa: PLC0415

    if path is None:
        return None
    view = read_supervision(path)
    try:
        return OnlineMonitor(view, proven.words)
    except InputError as problem:
        raise InputError(f"--monitor {path}: {problem}") from None


def _shown(
    settings: argparse.Namespace, beside: BandWatch, monitored: OnlineMonitor | None
) -> Callable[[RecordingState], object]:
    begun, last = time.monotonic(), [0]
    shown_notes: list[str] = []

    def shown(so_far: RecordingState) -> None:
        show_notes(so_far, shown_notes)
        if so_far.last is not None and so_far.rows > last[0]:
            last[0] = so_far.rows
            beside.see(so_far.last)
            if monitored is not None:
                monitored.see(so_far.last)
        if not settings.quiet:
            seen = beside.seen
            band = "" if seen.band is None else f"; proven {seen.band[0]:.4g}…{seen.band[1]:.4g} °C"
            told = (*seen.notes(), *(() if monitored is None else monitored.messages()))
            found = f" NOT WELL: {told[-1]}" if told else ""
            LINE.show(lambda: f"{live_line(so_far, time.monotonic() - begun)}{band}{found}"[:118])

    return shown


def _refitted(log: Path, proven: ProvenWords) -> dict[str, Any]:
    """Return each parameter as it is now, beside what the proof was made on."""
    try:
        fitted = chain.fit(log)
    except HeatertuneError as problem:
        return {"message": f"the log does not tell the heater: {problem}"}
    found = {}
    for name in ("gain_degC_per_pct", "time_constant_s", "dead_time_s", "ambient_degC"):
        now, interval = getattr(fitted.model, name), fitted.ci95.get(name)
        was = getattr(proven.fitted_model.model, name)
        apart = interval is not None and (
            (interval.low is not None and was < interval.low) or (interval.high is not None and was > interval.high))
        found[name] = {"was": was, "now": now, "low": interval and interval.low, "high": interval and interval.high,
                       "moved": apart}
    return {"message": fitted.outcome_text, "parameters": found}


def _lines(document: Mapping[str, Any]) -> str:
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
