"""`heatertune experiment`: a plan, run on a controller in manual, watched, and given back as it was found."""

from __future__ import annotations

import argparse
import shlex
import signal
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from typing import TYPE_CHECKING, Any, Final

from heatertune import chain
from heatertune.cli import printing
from heatertune.cli.printing import LINE
from heatertune.errors import HeatertuneError, InputError
from heatertune.live.client.connection import address_of
from heatertune.live.commands.record_watch import ALL_SIGNALS, end_requests, live_line, tell

if TYPE_CHECKING:
    from heatertune.live.experiment import Aims, Experiment, ExperimentResult
    from heatertune.live.recorder import RecordingState
    from heatertune.live.write.band import Reach

__all__ = ["EXPERIMENT_EXAMPLE", "add_experiment"]

EXPERIMENT_EXAMPLE: Final = ("example: heatertune experiment plan.csv s7://plc/0/2/db30 --limit-temperature 70 "
                   "--design out/ -o log.csv")
_FIELDS: Final = {"gain": "gain_degC_per_pct", "time-constant": "time_constant_s", "dead-time": "dead_time_s"}


def add_experiment(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "experiment", help="run what plan designed on the controller, monitored, and restore its mode",
        epilog=EXPERIMENT_EXAMPLE,
        description="Switch the controller to manual, set the powers of the plan, and record. It starts after checks "
                    "and a confirmation, stops at once beyond a limit, and restores mode and manual value however it "
                    "ends.",
    )
    command.add_argument("plan", metavar="PLAN", nargs="?", help="CSV file that heatertune plan wrote")
    command.add_argument("address", metavar="ADDRESS", nargs="?", help="as for heatertune record")
    command.add_argument("--design", metavar="DIR", help="folder of the controller at this address")
    command.add_argument("-o", "--out", metavar="FILE", help="the log to write")
    limits = command.add_argument_group("limits that stop it at once")
    limits.add_argument("--limit-temperature", type=float, metavar="°C",
                        help="a temperature as high as this (default: what the specification allows)")
    limits.add_argument("--limit-rate", type=float, metavar="°C/MIN", help="a faster change, up or down")
    command.add_argument("--until", action="append", default=[], metavar="NAME=SHARE%",
                         help="stop as soon as a parameter is known this well: gain=5%%, time-constant=10%%, "
                              "dead-time=20%%; may be repeated (default: the whole plan)")
    command.add_argument("--yes", action="store_true", help="start without confirmation")
    command.add_argument("--without-dead-man", action="store_true",
                         help="start although the PLC would hold the last power if this machine failed")
    command.add_argument("--in-manual", action="store_true",
                         help="the controller is in manual already, and returns to manual at the same value")
    command.add_argument("--restore", action="store_true",
                         help="with ADDRESS alone: restore what the PLC held before an interrupted experiment")
    printing.add_output_options(command, _run_experiment)


def _run_experiment(settings: argparse.Namespace) -> int:
    from heatertune.proof.words_file import pwm_period_in, words_in

    if settings.restore:
        return _restored(settings)
    if settings.design is None:
        raise InputError("experiment needs --design DIR: the folder whose controller runs there")
    words, _ = words_in(settings.design)
    if None in (settings.plan, settings.address, settings.out):
        raise InputError("experiment needs PLAN, ADDRESS, -o FILE and --limit-temperature")
    settings.limit_temperature = _limit_degC(settings)
    from heatertune.live.experiment import AbortLimits, Experiment, ExperimentObserver, read_plan

    plan, address, aims = read_plan(settings.plan), address_of(settings.address), _aims(settings.until)
    limits = AbortLimits(temperature_degC=settings.limit_temperature, rate_degC_per_min=settings.limit_rate)
    whole = Experiment(plan, address, words, limits, pwm_period_s=pwm_period_in(settings.design),
                       reach=_reach(settings.design), in_manual=settings.in_manual)
    blind = () if whole.reach is not None else (
        f"no heater in {settings.design}: neither a frozen sensor nor a rise that no heater makes is noticed",)
    checks = (*whole.check(), *blind)
    _agree(settings, whole, checks)
    with end_requests(ALL_SIGNALS) as requests:
        ended = whole.run(settings.out, aims, ExperimentObserver(
            on_row=_shown(settings, whole), key=lambda: bool(requests), fit=_fit if aims.shares else None,
            progress=_to_terminal, enough=lambda: requests.count(signal.SIGINT) > 1))
    LINE.end()
    document = _document(settings, ended)
    printing.output(settings, document, lambda: _lines(document))
    return 0 if ended.reason in ("plan", "known") and ended.restored else 1


def _limit_degC(settings: argparse.Namespace) -> float:
    """Return the temperature that ends it: the stated one, which the folder's specification may not forbid."""
    from heatertune.live.serve import read_folder
    from heatertune.proof.specification import highest_temperature

    highest = None
    with suppress(HeatertuneError):  # words alone, without the conditions of a design
        highest = highest_temperature(read_folder(settings.design)[2])
    limit: float | None = highest if settings.limit_temperature is None else settings.limit_temperature
    if limit is None:
        raise InputError("experiment needs --limit-temperature: the specification of the design names no highest "
                         "temperature")
    if highest is not None and not limit <= highest:
        raise InputError(f"--limit-temperature {limit:g}: the specification or interlock of {settings.design} allows "
                         f"at most {highest:g} °C: say {highest:g} or less")
    return limit


def _reach(folder: str) -> Reach | None:
    """Return the reach of the plausible heaters of a folder's design, None where it holds no model."""
    from heatertune.live.serve import read_folder
    from heatertune.live.write.band import Reach

    with suppress(HeatertuneError):
        words, fitted, conditions = read_folder(folder)
        return Reach(words, fitted, conditions.noise_degC, conditions.cooling_gain or 0.0)
    return None


def _aims(said: list[str]) -> Aims:
    from heatertune.live.experiment import Aims

    shares = {}
    for text in said:
        name, _, share = text.partition("=")
        try:
            number = float(share.removesuffix("%")) / 100.0
        except ValueError:
            number = 0.0
        if name not in _FIELDS or not 0.0 < number < 1.0:
            raise InputError(f"--until {text!r}: expected one of {', '.join(_FIELDS)}, =, and a share as 5%")
        shares[_FIELDS[name]] = number
    return Aims(shares=shares)


def _agree(settings: argparse.Namespace, whole: Experiment, differences: tuple[str, ...]) -> None:
    """Ask for the yes."""
    if not whole.has_dead_man and not settings.without_dead_man:
        raise InputError("no dead man is known of this PLC: if this machine died, the power would stay as it is; "
                         "--without-dead-man begins all the same")
    if settings.yes:
        return
    if not sys.stdin.isatty():
        raise InputError("experiment asks before it begins: answer at a terminal, or say --yes")
    print(*(f"- {each}" for each in differences), sep="\n", file=sys.stderr)
    plan = whole.plan
    print(f"Up to {max(plan.powers):g} % in manual for {plan.ends_s:.0f} s; stops at {settings.limit_temperature:g} "
          "°C. Start? Type yes: ", end="", flush=True, file=sys.stderr)
    if sys.stdin.readline().strip().lower() != "yes":
        raise InputError("not begun: nothing has been changed")


def _shown(settings: argparse.Namespace, whole: Experiment) -> Callable[[RecordingState, str], object]:
    start_s = time.monotonic()
    first: list[float] = []

    def shown(so_far: RecordingState, hand: str) -> None:
        if settings.quiet:
            return
        if so_far.last is not None and not first:
            first.append(so_far.last.time_s)
        left = whole.plan.ends_s - (so_far.last.time_s - first[0]) if so_far.last is not None else whole.plan.ends_s
        LINE.show(lambda: f"{live_line(so_far, time.monotonic() - start_s, hand)}; {left:.0f} s left")

    return shown


def _fit(log: Any) -> Any:

    return chain.fit(log)


def _to_terminal(message: str) -> None:
    tell(f"{message} (Ctrl-C twice: no longer)")


def _restored(settings: argparse.Namespace) -> int:
    from heatertune.live.experiment import restore

    sources = [each for each in (settings.plan, settings.address) if each is not None]
    if len(sources) != 1:
        raise InputError("experiment --restore needs ADDRESS, and no PLAN")
    address = address_of(sources[0])
    restored = restore(address, progress=tell)
    document = {"schema": "heatertune/experiment/2", "address": address.text, "restored": restored}
    printing.output(settings, document, lambda: f"{address.text}: {_of_restored(restored, address.text)}")
    return 0 if restored else 1


def _of_restored(restored: bool | None, address: str, power_pct: float | None = None) -> str:
    """Return the content of the PLC, as far as it is known."""
    if restored is None:
        power = "" if power_pct is None else f" at {power_pct:g} %"
        return (f"UNKNOWN what stands there: no answer. The controller may be in manual{power}. Look at it; and once "
                f"it answers: heatertune experiment --restore {shlex.quote(address)}")
    return ("mode and manual value stand there as before" if restored else
            "somebody else has changed mode or manual value since: they were left alone")


def _document(settings: argparse.Namespace, ended: ExperimentResult) -> dict[str, Any]:
    fitted = ended.fitted_model
    return {
        "schema": "heatertune/experiment/2", "address": settings.address, "log": settings.out, "ended": ended.reason,
        "message": ended.message, "restored": ended.restored, "power_pct": ended.power_pct,
        "rows": ended.recording.rows if ended.recording else 0, "gaps": ended.recording.gaps if ended.recording else 0,
        "model": None if fitted is None else {name: getattr(fitted.model, field) for name, field in _FIELDS.items()},
    }


def _lines(document: Mapping[str, Any]) -> str:
    good = document["ended"] in ("plan", "known")
    lines = [f"{'ended' if good else 'BROKEN OFF'}: {document['message']}",
             f"{document['address']}: {_of_restored(document['restored'], document['address'], document['power_pct'])}",
             f"{document['log']}: {document['rows']} rows"]
    if document["model"] is not None:
        lines[-1] += "; " + ", ".join(f"{name} {value:.4g}" for name, value in document["model"].items())
    if document["restored"] is None:
        lines.insert(0, "LOOK AT THE PLC NOW: it may still be in manual.")
    return "\n".join([*lines, f"next: heatertune fit {document['log']}"])
