"""`heatertune bench`: how fast this machine runs heatertune."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from heatertune.cli import printing
from heatertune.codec import encode
from heatertune.options import one_of
from heatertune.plc import NAMES
from heatertune.report.layout import table

if TYPE_CHECKING:
    from heatertune.bench import Throughput, Times

__all__ = ["add_to"]

_EXAMPLE = "example: heatertune bench --target weg --samples 500"


def add_to(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "bench", help="measure how fast this machine runs the closed loop, a proof on samples and a "
                      "fit", epilog=_EXAMPLE,
        description="Time the closed loop of a controller, plain and compiled, a proof on samples and a fit, "
                    "alternating with references; print the minimum, median and maximum of each. It takes about twenty "
                    "seconds, longer when a loop is compiled for the first time.",
    )
    command.add_argument("--target", default="s5-ob251", metavar="NAME", type=one_of(NAMES),
                         help=f"one of {', '.join(NAMES)}")
    command.add_argument("--samples", type=int, default=1000, metavar="N",
                         help="how many samples of 3,000 s are run on one processor and on all (default 1000)")
    command.add_argument("--rounds", type=int, default=7, metavar="N", help="how many runs of each (default 7)")
    printing.add_output_options(command)
    command.set_defaults(run=_run)


def _run(settings: argparse.Namespace) -> int:
    from heatertune.bench import speed  # noqa: PLC0415 - the help must not wait for it

    measured = speed(settings.target, settings.samples, rounds=settings.rounds, progress=printing.Progress(settings))
    printing.output(settings, encode(measured), lambda: _told(measured))
    return 0


def _told(speed: Throughput) -> str:

    def row(what: str, times: Times, form: str, meaning: str) -> tuple[str, ...]:
        return (what, *(format(each, form) for each in (times.least, times.median, times.most)), meaning)

    loop, rate, beside = speed.loop, speed.samples_per_s, speed.yardsticks
    rows = [
        ("", "min", "median", "max", ""),
        row("closed loop, compiled", loop.compiled_ns_per_scan, ",.1f", "ns per scan, drawn and measured"),
        row("closed loop, plain Python", loop.plain_ns_per_scan, ",.0f", "ns per scan"),
        row("for comparison: a PI in plain Python", beside.python_ns_per_scan, ",.0f", "ns per scan, no words, no PWM"),
        row("for comparison: SciPy's lfilter", beside.lfilter_ns_per_value, ",.1f", "ns per value, first order"),
        row("samples on 1 processor", rate.single_processor, ",.0f", "per second, 3,000 s each"),
        row(f"samples on {speed.processors} processors", rate.all, ",.0f", "per second"),
    ]
    rows += [row(f"fit of {int(count):,} rows", times, ",.0f", "ms, all candidates and intervals")
             for count, times in speed.fit_ms.items()]
    first = f"first samples: {speed.loop.first_samples_s:.2f} s, compiled or read from the cache"
    return (f"{speed.target}, a PI every second, PWM of 10 s; each of {speed.rounds} runs in turn\n\n{table(rows)}\n\n"
            f"{first}")
