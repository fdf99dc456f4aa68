"""Words → structured text: a program with WEG's block, one with a block of its own, and that one as a PLCopen project.

None of the files was tried in WPS or in another vendor's tool; parsers of the language and the format read them.
"""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final

from heatertune.plc.core import Sensor, count
from heatertune.plc.single import single
from heatertune.plc.weg.plcopen import project
from heatertune.plc.weg.program import PROBE, Clock, clock_for, enabling, literal, statements, variables
from heatertune.plc.weg.source import BLOCK_NAME, function_block
from heatertune.plc.weg.words import COUNTS, FIELDS
from heatertune.plc.words import Certificate, Words

__all__ = ["RENAMED", "export_words", "literal"]

_WIRES = (
    ("ManualSetPoint", "HandPower"), ("SelectSetPoint", "ByHand"),
    ("Feedback", "HeaterTemperature"),
)

#: input of WEG's block → input of the exported one, where the language reserves the name
RENAMED: Final = {"Type": "Form", "Action": "Acting"}


def export_words(words: Words, certificate: Certificate) -> dict[str, str]:
    """Return the three files; the same words and certificate give the same bytes."""
    clock, setpoint = clock_for(words, certificate.actuator), _setpoint(words, certificate)
    known = certificate.switches.get("sampling")
    kept = None if known is None else known == "block"
    head = (*_head(words, certificate, clock), *_by_hand(clock, certificate))
    comment = "\n".join(f"(* {line} *)" for line in head) + "\n"
    own = variables(words, clock, setpoint)
    body = statements(words, clock, _block_call(words))
    wegs = variables(words, clock, setpoint, calls_wegs=True, keeps_ts=kept)
    called = statements(words, clock, _weg_call(words), calls_wegs=True, keeps_ts=kept)
    instances = {"HeaterPid": "FB_PID"} | ({PROBE: "FB_PID"} if kept is None else {})
    return {
        "weg_pid_call.st": comment + _program("WegHeater", instances, wegs, called),
        "weg_pid_block.st":
            comment + function_block() + "\n" + _program("Heater", {"HeaterPid": BLOCK_NAME}, own, body),
        "weg_pid_plcopen.xml": project(own, body, head, clock.tick_ms),
    }


def _setpoint(words: Words, certificate: Certificate) -> float:
    """Return the setpoint as the proof had it: a count of the input module, in °C."""
    s = words.scaling
    proven = s.low_degC if certificate.setpoint_degC is None else certificate.setpoint_degC
    return single(s.low_degC + s.span_degC * count(Sensor(s.low_degC, s.span_degC, COUNTS), proven) / COUNTS)


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


def _called(instance: str, wires: list[tuple[str, str]]) -> str:
    return f"{instance}(\n" + ",\n".join(f"  {name} := {value}" for name, value in wires) + ");\n"


def _weg_call(words: Words) -> str:
    """Return the statements in the form of the manual's example: EN and Output as members."""
    call = _called("HeaterPid", [*_wires(words), *_values(words)])
    return f"HeaterPid.EN := {enabling(words)};\n{call}HeaterPower := HeaterPid.Output;\n"


def _block_call(words: Words) -> str:
    values = [(RENAMED.get(name, name), value) for name, value in _values(words)]
    call = _called("HeaterPid", [("Enable", enabling(words)), *_wires(words), *values])
    return f"{call}HeaterPower := HeaterPid.Output;\n"


def _program(
    name: str, instances: Mapping[str, str], listed: tuple[tuple[str, str, str, str], ...], body: str
) -> str:
    declared = "".join(f"  {n} : {t} := {v}; (* {meaning} *)\n" for n, t, v, meaning in listed)
    declared += "".join(f"  {instance} : {block};\n" for instance, block in instances.items())
    return f"PROGRAM {name}\nVAR\n{declared}END_VAR\n\n{body}\nEND_PROGRAM\n"
