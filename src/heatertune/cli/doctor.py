"""`heatertune doctor`: says whether this installation works."""

from __future__ import annotations

import argparse
from typing import TYPE_CHECKING, Any

from heatertune.cli import printing
from heatertune.report.layout import table

if TYPE_CHECKING:
    from heatertune.doctor import InstallationCheck

__all__ = ["add_to"]

_EXAMPLE = "example: heatertune doctor"


def add_to(commands: Any) -> None:
    """Add the command."""
    command = commands.add_parser(
        "doctor", help="check this installation: versions, solvers, caches, extras", epilog=_EXAMPLE,
        description="Check Python, the packages, IPOPT, both caches, the extras and the paper's tables, with a remedy "
                    "for each fault. Exit status 1 if something that heatertune needs is broken.",
    )
    printing.add_output_options(command)
    command.set_defaults(run=_run)


def _run(settings: argparse.Namespace) -> int:
    from heatertune.doctor import document, examine, works  # noqa: PLC0415 - it loads what it looks at

    findings = examine()

    def lines() -> str:
        rows = [(_mark(finding), finding.name, finding.value) for finding in findings]
        remedies = [f"{finding.name}: {finding.remedy}" for finding in findings if not finding.ok]
        return "\n".join([table(rows), *remedies, "all that is needed works" if works(findings) else "FAIL: see above"])

    printing.output(settings, document(findings), lines)
    return 0 if works(findings) else 1


def _mark(finding: InstallationCheck) -> str:
    return "ok" if finding.ok else "FAIL" if finding.required else "-"
