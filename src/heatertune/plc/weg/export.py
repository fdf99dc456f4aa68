"""Words → structured text: the call of WEG's block, a block for controllers without one, and both as a PLCopen project.

None of the files was tried in WPS or in another vendor's tool; parsers of the language and the format read them.
"""

from __future__ import annotations

from decimal import Decimal
from typing import Final

from heatertune.plc.ramp import Number, for_coolers
from heatertune.plc.single import single
from heatertune.plc.weg.plcopen import project
from heatertune.plc.weg.source import BLOCK_NAME, function_block
from heatertune.plc.weg.words import FIELDS
from heatertune.plc.words import Certificate, Words

__all__ = ["RENAMED", "export_words", "literal"]

#: variables of the program around the block; the names are free
_VARIABLES = (
    ("HeaterOn", "BOOL", "FALSE", "enables the controller"),
    ("ByHand", "BOOL", "FALSE", "TRUE: HandPower is the output"),
    ("HandPower", "REAL", "0.0", "output by hand, %"),
    ("HeaterSetPoint", "REAL", "0.0", "degC"),
    ("HeaterTemperature", "REAL", "0.0", "degC, from the input module"),
    ("HeaterPower", "REAL", "0.0", "%, to the PWM"),
)

#: further ones where a ramp leads the setpoint
_RAMP_VARIABLES = (
    ("HeaterRamp", "REAL", "0.0", "degC, the setpoint on its ramp"),
    ("HeaterRampCalls", "INT", "0", "calls since its last step"),
    ("HeaterWasOn", "BOOL", "FALSE", "HeaterOn of the call before"),
)
_HOLD_VARIABLES = (("HeaterLimit", "REAL", "0.0", "degC, how far from the temperature the ramp may be"),)

_WIRES = (
    ("ManualSetPoint", "HandPower"), ("SelectSetPoint", "ByHand"),
    ("Feedback", "HeaterTemperature"),
)

#: numbers in this range are written without an exponent
_LOWEST_PLAIN: Final = 1e-4
_PLAIN: Final = 1e6

#: input of WEG's block → input of the exported one, where the language reserves the name
RENAMED: Final = {"Type": "Form", "Action": "Acting"}


def export_words(words: Words, certificate: Certificate) -> dict[str, str]:
    """Return the three files; the same words and certificate give the same bytes."""
    head = _head(words, certificate)
    comment = "\n".join(f"(* {line} *)" for line in head) + "\n"
    return {
        "weg_pid_call.st": comment + _program("WegHeater", "FB_PID", words, _weg_call(words)),
        "weg_pid_block.st":
            comment + function_block() + "\n" + _program("Heater", BLOCK_NAME, words, _block_call(words)),
        "weg_pid_plcopen.xml": project(_variables(words), _block_call(words), head, words.whole["Ts"]),
    }


def literal(value: float) -> str:
    """Return the shortest decimal that is this single, as the language writes a REAL."""
    digits = next(n for n in range(1, 10) if single(float(f"{value:.{n}g}")) == value)
    shortest = f"{value:.{digits}g}"
    if _LOWEST_PLAIN <= abs(value) < _PLAIN or value == 0.0:
        plain = f"{Decimal(shortest):f}"
        return plain if "." in plain else f"{plain}.0"
    mantissa, _, exponent = f"{value:.{digits - 1}e}".partition("e")
    return f"{mantissa}{'' if '.' in mantissa else '.0'}E{int(exponent)}"


def _head(words: Words, certificate: Certificate) -> tuple[str, ...]:
    scale = words.scaling
    return (
        "heater controller for WEG's PID block",
        f"sensor {scale.low_degC:g}...{scale.high_degC:g} degC; called every {words.whole['Ts']} ms; output in percent",
        *certificate.head,
        "not tried in WPS or another vendor's tool",
    )


def _values(words: Words) -> list[tuple[str, str]]:
    return [
        (f.name, literal(words.values[f.name]) if f.format == "REAL" else str(words.whole[f.name])) for f in FIELDS
    ]


def _variables(words: Words) -> tuple[tuple[str, str, str, str], ...]:
    if words.ramp is None:
        return _VARIABLES
    return _VARIABLES + _RAMP_VARIABLES + (() if words.ramp.hold is None else _HOLD_VARIABLES)


def _wires(words: Words) -> list[tuple[str, str]]:
    return [("SetPoint", "HeaterSetPoint" if words.ramp is None else "HeaterRamp"), *_WIRES]


def _ramp(words: Words) -> str:
    """Return the statements that lead the setpoint; it begins at the reading of the call that enables the block."""
    if words.ramp is None:
        return ""
    step, calls = literal(words.ramp.step), words.ramp.calls
    below, lowest, above = ("", "HeaterSetPoint", "") if words.ramp.hold is None else _held(words.ramp.hold)
    arrived = "  ELSE\n" if not below else "  ELSIF NOT (HeaterRamp > HeaterSetPoint) THEN\n"
    moves = (
        f"{below}"
        "  IF HeaterRamp < HeaterSetPoint THEN\n"
        f"    HeaterRamp := HeaterRamp + {step};\n"
        "    IF HeaterRamp > HeaterSetPoint THEN\n      HeaterRamp := HeaterSetPoint;\n    END_IF;\n"
        f"  ELSIF HeaterRamp > {lowest} THEN\n"
        f"    HeaterRamp := HeaterRamp - {step};\n"
        f"    IF HeaterRamp < {lowest} THEN\n      HeaterRamp := {lowest};\n    END_IF;\n"
        f"{arrived}    HeaterRamp := HeaterSetPoint;\n  END_IF;\nEND_IF;\n{above}"
    )
    if words.ramp.cools:
        moves = for_coolers(moves, {"<": ">", "+": "-"})
    return (
        "IF NOT HeaterWasOn THEN\n  HeaterRamp := HeaterTemperature;\n  HeaterRampCalls := 0;\nEND_IF;\n"
        "HeaterWasOn := HeaterOn;\nHeaterRampCalls := HeaterRampCalls + 1;\n"
        f"IF HeaterRampCalls >= {calls} THEN\n  HeaterRampCalls := 0;\n{moves}"
    )


def _held(size: Number) -> tuple[str, str, str]:
    """Return the statements that find the lowest setpoint, its name, and those that keep the setpoint from above."""
    hold = literal(abs(size))
    return (
        f"  HeaterLimit := HeaterTemperature - {hold};\n"
        "  IF NOT (HeaterLimit > HeaterSetPoint) THEN\n    HeaterLimit := HeaterSetPoint;\n  END_IF;\n",
        "HeaterLimit",
        f"HeaterLimit := HeaterTemperature + {hold};\n"
        "IF HeaterRamp > HeaterLimit THEN\n  HeaterRamp := HeaterLimit;\nEND_IF;\n",
    )


def _called(instance: str, wires: list[tuple[str, str]]) -> str:
    return f"{instance}(\n" + ",\n".join(f"  {name} := {value}" for name, value in wires) + ");\n"


def _weg_call(words: Words) -> str:
    """Return the statements in the form of the manual's example: EN and Output as members."""
    call = _called("HeaterPid", [*_wires(words), *_values(words)])
    return f"{_ramp(words)}HeaterPid.EN := HeaterOn;\n{call}HeaterPower := HeaterPid.Output;\n"


def _block_call(words: Words) -> str:
    values = [(RENAMED.get(name, name), value) for name, value in _values(words)]
    call = _called("HeaterPid", [("Enable", "HeaterOn"), *_wires(words), *values])
    return f"{_ramp(words)}{call}HeaterPower := HeaterPid.Output;\n"


def _program(name: str, block: str, words: Words, body: str) -> str:
    declared = "".join(f"  {n} : {t} := {v}; (* {meaning} *)\n" for n, t, v, meaning in _variables(words))
    return f"PROGRAM {name}\nVAR\n{declared}  HeaterPid : {block};\nEND_VAR\n\n{body}\nEND_PROGRAM\n"
