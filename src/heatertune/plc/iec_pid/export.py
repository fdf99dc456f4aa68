"""Words → structured text: the block, a program that calls it, and both as a PLCopen project.

No file was tried in a vendor's tool; parsers of the language and the format read them.
"""

from __future__ import annotations

from collections.abc import Iterable
from typing import Final

from heatertune.plc.iec_pid.source import SOURCE
from heatertune.plc.iec_pid.words import COUNTS, FIELDS
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
from heatertune.plc.words import Certificate, WordField, Words

__all__ = ["PROJECT", "TEXT", "constants", "export_words", "head_of"]

TEXT: Final = "iec_pid.st"
PROJECT: Final = "iec_pid_plcopen.xml"


def export_words(words: Words, certificate: Certificate) -> dict[str, str]:
    """Return both files; the same words and certificate give the same bytes."""
    clock = clock_for(words, certificate.actuator)
    head = (*head_of("heater controller: the PID of IEC 61131-3, repaired", words, certificate, clock),
            *_by_hand(clock, certificate))
    own = variables(words, clock, proven_setpoint(words, certificate, COUNTS))
    limits = Limits(most=words.values["XMAX"], cools=words.values["KP"] < 0.0)
    body = statements(words, clock, _call(words), limits)
    text = (*(f"(* {line} *)" for line in head), function_block(SOURCE))
    return {
        TEXT: "\n".join(text) + "\n" + program("Heater", {"HeaterPid": SOURCE.name}, own, body),
        PROJECT: project(SOURCE, own, body, head, clock.tick_ms),
    }


def head_of(title: str, words: Words, certificate: Certificate, clock: Clock) -> tuple[str, ...]:
    """Return what an exported text says first."""
    scale = words.scaling
    pwm = f"PWM in the program, steps of {clock.tick_ms} ms" if clock.steps else f"no PWM in the program: {clock.why}"
    return (
        title,
        f"sensor {scale.low_degC:g}...{scale.high_degC:g} degC; TA: called every {words.whole['CYCLE']} ms; output in "
        f"percent; {pwm}",
        *certificate.head,
        "not tried in a vendor's tool",
    )


def constants(words: Words, fields: Iterable[WordField]) -> list[tuple[str, str]]:
    """Return the words as literals of the language."""
    return [(f.name, f"T#{words.whole[f.name]}ms" if f.format == "TIME" else literal(words.values[f.name]))
            for f in fields]


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
        "leave the variables and the block without retention: each start-up is from cold then, as proven",
        f"setpoint: HeaterSetPoint begins {loaded}; another one is not proven",
    )
    return ["remains to be done by hand:", *(f"  {number}. {step}" for number, step in enumerate(steps, start=1))]


def _call(words: Words) -> str:
    setpoint = "HeaterSetPoint" if words.ramp is None else "HeaterRamp"
    wires = [("RUN", enabling(words)), ("AUTO", "NOT ByHand"), ("PV", "HeaterTemperature"), ("SP", setpoint),
             ("X0", "HandPower"), *constants(words, FIELDS)]
    return f"{called('HeaterPid', wires)}HeaterPower := HeaterPid.XOUT;\n"
