"""Whether what a FAIL suggests passes when typed: `python -m tests.bench.suggestions [TARGET,…] [SECONDS]`.

Heaters of five kinds are tuned under requests that ask too much of some controllers; each suggested command is run as it
stands on the screen, and has to break no limit, or, where it is called the nearest that passes, to PASS.
"""

import contextlib
import io
import re
import shlex
import sys
import time

from heatertune.cli import main

#: kind → gain [°C/%], time constant [s], dead time [s], setpoint [°C], upper end of the sensor [°C]
HEATERS = {
    "slow": (0.8, 480, 60, 60, 100), "dead time": (0.53, 3200, 2090, 40, 50), "fast": (1.88, 59, 1.41, 83, 150),
    "ripple": (1.0, 38, 11, 60, 100), "kiln": (9.0, 3600, 120, 600, 1300)}
REQUESTS = (
    "", "--ms 2 --boost none --setpoint-ramp none --sample-time 5", "--tolerance 0.2", "--structure p",
    "--limit overshoot=2% --setpoint-ramp none --boost none", "--limit overshoot=0.1% --limit recovery-overshoot=0.1%")
LABELS = {"nearest that passes:\n": ("PASS",), "no limit is broken by:\n": ("PASS", "NOT PROVEN")}


def run(words):
    """Return the exit status and the screen of a command."""
    out = io.StringIO()
    with contextlib.redirect_stdout(out), contextlib.redirect_stderr(io.StringIO()):
        status = main([str(word) for word in words])
    return status, out.getvalue()


def request(target, heater, options):
    """Return the command of a request."""
    gain, lag, dead, setpoint, high = HEATERS[heater]
    return ["tune", "--gain", gain, "--time-constant", lag, "--dead-time", dead, "--ambient", 20, "--target", target,
            "--setpoint", setpoint, "--range", 0, high, "--quiet", *options.split()]


def suggestion(screen):
    """Return what a screen suggests and the verdicts that keep its word; None: it suggests nothing."""
    text = screen.replace("\\\n", " ")
    for label, verdicts in LABELS.items():
        if label in text:
            return shlex.split(text.partition(label)[2].splitlines()[0])[1:], verdicts
    return None


def limits_suggested(command, options):
    """Return the limits that a suggested command has and its request has not, name → value."""
    text = " ".join(map(str, command))
    found = re.findall(r"--limit ([\w-]+)=(\S+)|--(tolerance) (\S+)", text)
    own = set(re.findall(r"--limit ([\w-]+=\S+)|--(tolerance \S+)", options))
    return {name or named: value or valued for name, value, named, valued in found
            if (f"{name}={value}", "") not in own and ("", f"{named} {valued}") not in own}


def main_():
    """Print each case, and end with status 1 where a suggestion does not keep its word."""
    targets = (sys.argv[1] if len(sys.argv) > 1 else "s7-300,weg,s5-ob251,pid-compact").split(",")
    until, broken = time.monotonic() + float(sys.argv[2] if len(sys.argv) > 2 else 600.0), 0
    for target in targets:
        for heater in HEATERS:
            for options in REQUESTS:
                if time.monotonic() > until:
                    return broken
                status, screen = run(request(target, heater, options))
                if status == 2 or not screen.startswith("FAIL"):
                    print(f"{target}, {heater}, {options}: {screen[:40]!r}")
                    continue
                found = suggestion(screen)
                if found is None:
                    print(f"{target}, {heater}, {options}: nothing suggested")
                    continue
                command, verdicts = found
                answer = run(command)[1]
                kept = answer.startswith(verdicts)
                broken += not kept
                print(f"{'kept' if kept else 'BROKEN'}: {target}, {heater}, {options}: {shlex.join(command)}: {answer[:40]!r}")
    return broken


if __name__ == "__main__":
    raise SystemExit(1 if main_() else 0)
