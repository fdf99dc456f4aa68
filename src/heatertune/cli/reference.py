"""Commands for reference (`targets`, `terms`, `spec`) and about the installation (`doctor`, `bench`, `completion`)."""

from __future__ import annotations

import argparse
import dataclasses
import textwrap
from collections.abc import Iterator
from pathlib import Path
from typing import TYPE_CHECKING, Any, Final

from heatertune import __version__, options, plc
from heatertune.cli import printing
from heatertune.codec import encode
from heatertune.plc.targets import NAMES, target_by_name
from heatertune.report.layout import table
from heatertune.settings import Conditions
from heatertune.units import TERMS, GlossaryTerm, the_term
from heatertune.writing import write_files

if TYPE_CHECKING:
    from heatertune.bench import Throughput, Times
    from heatertune.doctor import InstallationCheck
    from heatertune.pid.design_values import Timer

__all__ = [
    "BENCH_EXAMPLE", "COMPLETION_EXAMPLE", "DOCTOR_EXAMPLE", "SPEC_EXAMPLE", "TARGETS_EXAMPLE", "TERMS_EXAMPLE",
    "add_bench", "add_completion", "add_doctor", "add_spec", "add_targets", "add_terms",
]


TERMS_EXAMPLE = "example: heatertune terms TA TN Ms"

_LEFT: Final = 20  # columns of the names


def add_terms(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "terms", help="what TA, TN, Ms, plausible heater … mean", epilog=TERMS_EXAMPLE,
        description="Explain the symbols and terms that heatertune prints.",
    )
    command.add_argument("term", nargs="*", metavar="TERM", help="a symbol or term (default: all)")
    printing.add_output_options(command, _run_terms)


def _run_terms(settings: argparse.Namespace) -> int:
    chosen = tuple(map(the_term, settings.term)) or TERMS
    document = {"schema": "heatertune/terms/1", "terms": [dataclasses.asdict(term) for term in chosen]}
    printing.output(settings, document, lambda: "\n".join(map(_term_text, chosen)))
    return 0


def _term_text(term: GlossaryTerm) -> str:
    name, *others = term.names
    unit = f" [{term.unit}]" if term.unit not in ("", "1") else ""
    meaning = f"{', '.join(others)}{unit}: {term.meaning}" if others else term.meaning
    return textwrap.fill(meaning, printing.WIDTH, initial_indent=f"{name:{_LEFT - 1}} ", subsequent_indent=" " * _LEFT)


SPEC_EXAMPLE = "example: heatertune spec oven --limit overshoot=3degC -o spec.toml"


def add_spec(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "spec", help="print the specification in force as a file, with the reason for each limit", epilog=SPEC_EXAMPLE,
        description="Print the limits that parameters must keep, as a file to edit and use with --spec.",
    )
    command.add_argument("spec", metavar="NAME|FILE.toml", nargs="?",
                         help="a preset (heatertune spec --list) or a file (default: general)")
    options.add(command, Conditions, "limit", "profile")
    command.add_argument("-o", "--out", metavar="FILE.toml", help="write the specification to this file")
    command.add_argument("--list", action="store_true", help="list the presets")
    printing.add_output_options(command, _run_spec)


def _run_spec(settings: argparse.Namespace) -> int:
    from heatertune.proof.specification import PRESETS, in_force, spec_text

    if settings.list:
        document = {"schema": "heatertune/presets/1",
                    "presets": {name: one.description for name, one in PRESETS.items()}}
        printing.output(settings, document, lambda: table([(name, one.description) for name, one in PRESETS.items()]))
        return 0
    specification = in_force(settings.spec, settings.limit, settings.profile)
    document = {"schema": "heatertune/specification/1", **encode(specification)}
    if settings.out is not None:
        target = Path(settings.out)
        write_files(target.parent, {target.name: spec_text(specification)})
    printing.output(settings, document, lambda: spec_text(specification).rstrip("\n"))
    return 0


TARGETS_EXAMPLE = "example: heatertune targets"


def add_targets(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "targets", help="the controllers, their ranges, and what their manuals leave open", epilog=TARGETS_EXAMPLE,
        description="List the controllers, grouped by hardware.",
    )
    printing.add_output_options(command, _run_targets)


def _run_targets(settings: argparse.Namespace) -> int:

    document = {
        "schema": "heatertune/targets/1",
        "targets": [
            {
                "name": controller.name,
                "group": group,
                "title": controller.title,
                "can": controller.can,
                "cannot": controller.cannot,
                "sample_time_s": _times(controller.timer),
                "words": [{"name": f.name, "address": f.address, "low": f.low, "high": f.high, "format": f.format}
                          for f in controller.fields],
                "inputs": dict(controller.inputs),
                "switches": [{"name": s.name, "settings": s.settings, "why": s.reason, "chosen": s.chosen}
                             for s in controller.switches],
            }
            for group, names in plc.GROUPS.items() for controller in map(plc.controller_for, names)
        ],
    }
    overview = "\n".join(f"{group}: {', '.join(names)}" for group, names in plc.GROUPS.items())
    printing.output(settings, document, lambda: "\n\n".join([overview, *map(_target_text, document["targets"])]))
    return 0


def _times(timer: Timer) -> dict[str, float]:
    return {"shortest": timer.shortest_s, "longest": timer.longest_s, "step": timer.step_s}


def _target_text(target: Any) -> str:
    times = target["sample_time_s"]
    lines = [
        f"{target['name']}: {target['title']}",
        f"  TA {times['shortest']:g}…{times['longest']:g} s in steps of {times['step']:g} s",
        *[f"  can: {sentence}" for sentence in target["can"]],
        *[f"  can't: {sentence}" for sentence in target["cannot"]],
        "  words " + ", ".join(_word(w) for w in target["words"]),
        "  inputs of a scan " + ", ".join(f"{name} ({form})" for name, form in target["inputs"].items()),
    ]
    for title, chosen in (("left open by the manual, proven under every setting", False), ("chosen by --assume", True)):
        of_title = [s for s in target["switches"] if s["chosen"] == chosen]
        lines += [f"  {title}:"] if of_title else []
        lines += [f"    {s['name']} ({', '.join(s['settings'])}): {s['why']}" for s in of_title]
    return "\n".join(lines)


def _word(word: Any) -> str:
    real = word["format"] in ("REAL", "LREAL")
    return f"{word['name']} ({word['format']})" if real else f"{word['name']} {word['low']}…{word['high']}"


BENCH_EXAMPLE = "example: heatertune bench --target weg --samples 500"


def add_bench(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "bench", help="measure how fast this machine runs the closed loop, a proof on samples and a "
                      "fit", epilog=BENCH_EXAMPLE,
        description="Time the closed loop of a controller, plain and compiled, a proof on samples and a fit, "
                    "alternating with references; print the minimum, median and maximum of each. It takes about twenty "
                    "seconds, longer when a loop is compiled for the first time.",
    )
    command.add_argument("--target", default="s5-ob251", metavar="NAME", type=target_by_name,
                         help=f"one of {', '.join(NAMES)}")
    command.add_argument("--samples", type=int, default=1000, metavar="N",
                         help="how many samples of 3,000 s are run on one processor and on all (default 1000)")
    command.add_argument("--rounds", type=int, default=7, metavar="N", help="how many runs of each (default 7)")
    printing.add_output_options(command, _run_bench)


def _run_bench(settings: argparse.Namespace) -> int:
    from heatertune.bench import speed

    measured = speed(settings.target, settings.samples, rounds=settings.rounds, progress=printing.Progress(settings))
    printing.output(settings, encode(measured), lambda: _speed_text(measured))
    return 0


def _speed_text(speed: Throughput) -> str:

    def row(what: str, times: Times, form: str, meaning: str) -> tuple[str, ...]:
        return (what, *(format(each, form) for each in (times.least, times.median, times.most)), meaning)

    loop, rate, python = speed.loop, speed.samples_per_s, speed.yardsticks
    rows = [
        ("", "min", "median", "max", ""),
        row("closed loop, compiled", loop.compiled_ns_per_scan, ",.1f", "ns per scan, drawn and measured"),
        row("closed loop, plain Python", loop.plain_ns_per_scan, ",.0f", "ns per scan"),
        row("for comparison: a PI in plain Python", python.python_ns_per_scan, ",.0f", "ns per scan, no words, no PWM"),
        row("for comparison: SciPy's lfilter", python.lfilter_ns_per_value, ",.1f", "ns per value, first order"),
        row("samples on 1 processor", rate.single_processor, ",.0f", "per second, 3,000 s each"),
        row(f"samples on {speed.processors} processors", rate.all, ",.0f", "per second"),
    ]
    rows += [row(f"fit of {int(count):,} rows", times, ",.0f", "ms, all candidates and intervals")
             for count, times in speed.fit_ms.items()]
    first = f"first samples: {speed.loop.first_samples_s:.2f} s, compiled or read from the cache"
    return (f"{speed.target}, a PI every second, PWM of 10 s; each of {speed.rounds} runs in turn\n\n{table(rows)}\n\n"
            f"{first}")


COMPLETION_EXAMPLE = "example: heatertune completion bash"

_EPILOG = f"""\
bash: heatertune completion bash > ~/.local/share/bash-completion/completions/heatertune
zsh:  heatertune completion zsh > DIR/_heatertune, DIR being one of $fpath
fish: heatertune completion fish > ~/.config/fish/completions/heatertune.fish
man:  heatertune completion man > ~/.local/share/man/man1/heatertune.1

{COMPLETION_EXAMPLE}
"""

#: what stands for a file and for a directory in the help
_FILES: Final = ("FILE", "LOG", "LOG|proof", "MODEL", "PID", "PID|WORDS", "WORDS", "INPUTS", "IMAGE", "DUMP", "A", "B")
_DIRECTORIES: Final = ("DIR",)


def add_completion(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "completion", help="print a completion script for bash, zsh or fish, or the man page", epilog=_EPILOG,
        description="Print a completion script. Put it where the shell looks for completions, and start a new shell. "
                    "Or print the man page.",
        formatter_class=argparse.RawDescriptionHelpFormatter,
    )
    command.add_argument("shell", choices=("bash", "zsh", "fish", "man"), help="the shell, or man")
    command.set_defaults(run=_run_completion)


def _run_completion(settings: argparse.Namespace) -> int:
    import shtab

    from heatertune.cli import parser

    whole = parser()
    if settings.shell == "man":
        print(_man_page(whole), end="")
        return 0
    for action in _actions(whole):
        if action.dest == "target":
            action.choices = tuple(NAMES)
        elif action.metavar in _FILES:
            action.complete = shtab.FILE  # type: ignore[attr-defined]  # where shtab looks for it
        elif action.metavar in _DIRECTORIES:
            action.complete = shtab.DIRECTORY  # type: ignore[attr-defined]  # same
    print(shtab.complete(whole, shell=settings.shell))
    return 0


def _man_page(whole: argparse.ArgumentParser) -> str:
    """Return the help of all commands as a man page."""
    def shown(its: argparse.ArgumentParser) -> list[str]:
        lines = its.format_help().rstrip().replace("\\", "\\e").replace("-", "\\-").splitlines()
        return [".nf", *(f"\\&{line}" if line.startswith((".", "'")) else line for line in lines), ".fi"]

    subparsers = next(action for action in whole._actions if isinstance(action, argparse._SubParsersAction))
    parts = [f'.TH HEATERTUNE 1 "" "heatertune {__version__}"', ".SH NAME",
             "heatertune \\- from a heater's temperature log to proven PID parameters for your PLC",
             ".SH SYNOPSIS", "heatertune COMMAND [OPTION ...]", ".SH COMMANDS", *shown(whole)]
    for name, its in subparsers.choices.items():
        parts += [f".SH {name.upper()}", *shown(its)]
    return "\n".join([*parts, ""])


def _actions(parser: argparse.ArgumentParser) -> Iterator[argparse.Action]:
    """Yield every action of a parser and of its commands."""
    for action in parser._actions:  # argparse has no public way to them
        yield action
        if isinstance(action, argparse._SubParsersAction):
            for command in action.choices.values():
                yield from _actions(command)


DOCTOR_EXAMPLE = "example: heatertune doctor"


def add_doctor(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "doctor", help="check this installation: versions, solvers, caches, extras", epilog=DOCTOR_EXAMPLE,
        description="Check Python, the packages, IPOPT, both caches, the extras and the paper's tables, with a remedy "
                    "for each fault. Exit status 1 if something that heatertune needs is broken.",
    )
    printing.add_output_options(command, _run_doctor)


def _run_doctor(settings: argparse.Namespace) -> int:
    from heatertune.doctor import document, examine, works

    findings = examine()

    def lines() -> str:
        rows = [(_mark(finding), finding.name, finding.value) for finding in findings]
        remedies = [f"{finding.name}: {finding.remedy}" for finding in findings if not finding.ok]
        return "\n".join([table(rows), *remedies, "all that is needed works" if works(findings) else "FAIL: see above"])

    printing.output(settings, document(findings), lines)
    return 0 if works(findings) else 1


def _mark(finding: InstallationCheck) -> str:
    return "ok" if finding.ok else "FAIL" if finding.required else "-"
