"""The constants as text for the data block editor, and as an initialising subroutine in statement list.

Neither form was tried in STEP 7-Micro/WIN; the manuals and other tools' files agree on what is used here.
"""

from __future__ import annotations

from heatertune.plc.room import Certificate, Words
from heatertune.plc.s7_200.words import COUNTS, FIELDS

__all__ = ["export_words"]

#: PWM on Q0.0, ms base, update cycle time and pulse width; 16#CA of the paper never loads the cycle time
_CONTROL_BYTE = "16#CB"

_STORED = tuple(field for field in FIELDS if field.address.startswith("V"))


def export_words(words: Words, certificate: Certificate) -> dict[str, str]:
    """Return both files; the same words and certificate give the same bytes (CRLF, as the editor writes)."""
    return {
        "s7_200_constants.txt": _data_block(words, certificate),
        "s7_200_init.awl": _subroutine(words, certificate),
    }


def _head(words: Words, certificate: Certificate) -> list[str]:
    s = words.scaling
    repaired = "repaired: networks 3-7 run once per PWM cycle, in exact arithmetic"
    kind = "as printed" if words.whole["PRINTED"] else repaired
    return [
        f"// PID/PWM program, {kind}",
        f"// sensor {s.low_degC:g}...{s.high_degC:g} degC = 0...{COUNTS} counts in IB0; setpoint in counts on analog "
        "adjustment 0",
        *[f"// {line}" for line in certificate.head],
        "// not tried in STEP 7-Micro/WIN",
    ]


def _data_block(words: Words, certificate: Certificate) -> str:
    rows = [f"{f.address}\t{words.whole[f.name]}\t// {f.name}: {f.comment}" for f in _STORED]
    return _text([*_head(words, certificate), *rows])


def _subroutine(words: Words, certificate: Certificate) -> str:
    stored = [f"MOVW\t{words.whole[f.name]:+d}, {f.address}" for f in _STORED]
    cycle = f"MOVW\t{words.whole['CYCLE']:+d}, SMW68"
    pwm = [f"MOVB\t{_CONTROL_BYTE}, SMB67", cycle, "MOVW\t+0, SMW70", "PLS\t0", "ENI"]
    body = [
        "SUBROUTINE_BLOCK SBR_0:SBR0", "TITLE=constants and PWM of the heater controller",
        *_head(words, certificate), "BEGIN",
        "Network 1 // constants", "LD\tSM0.0", *stored,
        "Network 2 // PWM on Q0.0", "LD\tSM0.0", *pwm,
        "END_SUBROUTINE_BLOCK",
    ]
    return _text([f"\t{line}" if "\t" in line else line for line in body])


def _text(lines: list[str]) -> str:
    return "\r\n".join(lines) + "\r\n"
