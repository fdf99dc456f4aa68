"""A batch whose cases are roots: quick, and anybody can check them. Run as a program, it is what the tests kill."""

import json
import os
import signal
import sys
import time
from pathlib import Path

from heatertune.batch import CaseBatch, TableColumn, in_processes, run

COLUMNS = (
    TableColumn(name="name", kind="text", description="of the case"),
    TableColumn(name="outcome", kind="text", description="PASS for even numbers"),
    TableColumn(name="reason", kind="text", description="why not"),
    TableColumn(name="root", kind="float", description="square root"),
    TableColumn(name="square", kind="int", description="square"),
)


def row_of(shared, case):
    """Work for a while, tell the diary, and die where the shared settings say so."""
    if case in shared.get("always_deadly", ()):
        os.kill(os.getpid(), signal.SIGKILL)
    once = shared.get("deadly_once", {}).get(case)
    if once is not None and Path(once).exists():
        Path(once).unlink()
        os.kill(os.getpid(), signal.SIGKILL)
    end = time.perf_counter() + shared.get("seconds", 0.0)
    while time.perf_counter() < end:
        pass
    if "diary" in shared:
        with Path(shared["diary"]).open("a") as file:
            file.write(f"{case}\n")
    return expected_row(case)


def expected_row(case):
    outcome = "FAIL" if case % 2 else "PASS"
    return {"name": f"n{case}", "outcome": outcome, "reason": "odd" if case % 2 else None, "root": case**0.5,
            "square": case * case}


def lost(case, why):
    return {"name": f"n{case}", "outcome": "crashed", "reason": why}


def plainly(case):
    return case


def batch_of(number, **shared):
    return CaseBatch(do=row_of, common=shared, cases=range(number), sent=plainly, lost=lost, columns=COLUMNS,
                 identity={"number": number})


def main():
    told = json.loads(sys.argv[1])
    run(batch_of(told["number"], **told["shared"]), told["out"], workers=in_processes(told["jobs"]), resume=True)


if __name__ == "__main__":
    main()
