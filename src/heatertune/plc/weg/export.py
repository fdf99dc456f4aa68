"""Words → structured text: a program with WEG's block, one with a block of its own, and that one as a PLCopen project.

None of the files was tried in WPS or in another vendor's tool; parsers of the language and the format read them.
"""

from __future__ import annotations

from typing import Final

from heatertune.plc.st.plcopen import project
from heatertune.plc.st.program import (
    Clock,
    Limits,
    called,
    clock_for,
    enabling,
    literal,
    program,
    proven_setpoint,
    statements,
    variables,
)
from heatertune.plc.st.source import function_block
from heatertune.plc.weg.program import KEEPS, PROBE, PROBED, keeping
from heatertune.plc.weg.source import SOURCE
from heatertune.plc.weg.words import COUNTS, FIELDS, REVERSE
from heatertune.plc.words import Certificate, Words

__all__ = ["RENAMED", "export_words"]

_WIRES = (
    ("ManualSetPoint", "HandPower"), ("SelectSetPoint", "ByHand"),
    ("Feedback", "HeaterTemperature"),
)

#: input of WEG's block → input of the exported one, where the language reserves the name
RENAMED: Final = {"Type": "Form", "Action": "Acting"}


def export_words(words: Words, certificate: Certificate) -> dict[str, str]:
    """Return the three files; the same words and certificate give the same bytes."""
    clock, setpoint = clock_for(words, certificate.actuator), proven_setpoint(words, certificate, COUNTS)
    known = certificate.switches.get("sampling")
    kept = None if known is None else known == "block"
    head = (*_head(words, certificate, clock), *_by_hand(clock, certificate))
    comment = "\n".join(f"(* {line} *)" for line in head) + "\n"
    limits = Limits(words.values["MaximumOutput"], words.values["Action"] == REVERSE)
    own = variables(words, clock, setpoint)
    body = statements(words, clock, _block_call(words), limits)
    wegs = variables(words, clock, setpoint, keeping(kept))
    calls = statements(words, clock, _weg_call(words), limits, before=PROBED if kept is None else "", or_when=KEEPS)
    instances = {"HeaterPid": "FB_PID"} | ({PROBE: "FB_PID"} if kept is None else {})
    return {
        "weg_pid_call.st": comment + program("WegHeater", instances, wegs, calls),
        "weg_pid_block.st":
            comment + function_block(SOURCE) + "\n" + program("Heater", {"HeaterPid": SOURCE.name}, own, body),
        "weg_pid_plcopen.xml": project(SOURCE, own, body, head, clock.tick_ms),
    }


def _head(words: Words, certificate: Certificate, clock: Clock) -> tuple[str, ...]:
    scale, ts = words.scaling, words.whole["Ts"]
    pwm = f"PWM in the program, steps of {clock.tick_ms} ms" if clock.steps else f"no PWM in the program: {clock.why}"
    return (
        "heater controller for WEG's PID block",
        f"sensor {scale.low_degC:g}...{scale.high_degC:g} degC; TA: called every {ts} ms; output in percent; {pwm}",
        *certificate.head,
        "not tried in WPS or another vendor's tool",
    )


def _by_hand(clock: Clock, certificate: Certificate) -> list[str]:
    """Return what remains to be done by hand, numbered."""
    wired = "HeaterOutput" if clock.steps else "HeaterPower, through a PWM of yours as it was proven,"
    exact = f"; a scan longer than {clock.tick_ms} ms makes coarser pulses than were proven" if clock.steps else ""
    loaded = "the lowest" if certificate.setpoint_degC is None else "as proven"
    steps = (
        f"wire HeaterOn and HeaterTemperature (degC) to your inputs and {wired} to the heater's switch; HeaterOn must "
        "fall when the sensor breaks: that puts the heater off",
        f"ScanMs is the time of one scan: call the program from a task of {clock.tick_ms} ms, or write the time of the "
        f"last scan there each scan{exact}",
        _who_keeps_ts(certificate.switches.get("sampling")),
        "leave the variables and the block without retention: each start-up is from cold then, as proven",
        "HeaterOn has to stay TRUE: each time that it rises the first call gives 0",
        f"setpoint: HeaterSetPoint begins {loaded}; another one is not proven",
    )
    return ["remains to be done by hand:", *(f"  {number}. {step}" for number, step in enumerate(steps, start=1))]


def _who_keeps_ts(known: str | None) -> str:
    """Return what is known of it, or that the program finds out."""
    if known == "block":
        return "WEG's block keeps Ts itself, as you told (block): BlockKeepsTs is TRUE, and it is called each scan"
    if known is not None:
        return f"WEG's block is called each Ts, as you told ({known}): BlockKeepsTs is FALSE"
    return (f"who keeps Ts, WEG's block or its caller, the first scan after each start-up finds out ({PROBE}): "
            "BlockKeepsTs then shows it; a ladder of your own has to know")


def _values(words: Words) -> list[tuple[str, str]]:
    return [
        (f.name, literal(words.values[f.name]) if f.format == "REAL" else str(words.whole[f.name])) for f in FIELDS
    ]


def _wires(words: Words) -> list[tuple[str, str]]:
    return [("SetPoint", "HeaterSetPoint" if words.ramp is None else "HeaterRamp"), *_WIRES]


def _weg_call(words: Words) -> str:
    """Return the statements in the form of the manual's example: EN and Output as members."""
    call = called("HeaterPid", [*_wires(words), *_values(words)])
    return f"HeaterPid.EN := {enabling(words)};\n{call}HeaterPower := HeaterPid.Output;\n"


def _block_call(words: Words) -> str:
    values = [(RENAMED.get(name, name), value) for name, value in _values(words)]
    call = called("HeaterPid", [("Enable", enabling(words)), *_wires(words), *values])
    return f"{call}HeaterPower := HeaterPid.Output;\n"
