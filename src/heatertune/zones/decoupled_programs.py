"""The statements that decouple zones in exported programs: of STEP 7 into DISV, in structured text around the block.

They read the neighbours' sensors at the instant of the zone's own reading, in REALs and in the order of
`heatertune.zones.joint_kernel.neighbours_pct`. A reading that tells of a broken sensor is left out.
"""

from __future__ import annotations

import re
from collections.abc import Iterator
from typing import Final

from heatertune.errors import InputError
from heatertune.plc.cpu.s7_300.program import LEAST
from heatertune.plc.cpu.s7_300.source import real
from heatertune.plc.inputs import FOUR_TO_TWENTY
from heatertune.plc.single_precision import single
from heatertune.plc.st.program_text import literal
from heatertune.zones.decoupling import decoupling_arrays, neighbours_in
from heatertune.zones.joint_proof import JointProof

__all__ = ["decoupled_cont_c", "decoupled_text"]

_DISV: Final = "DB41.DBD   68"
_TICK: Final = 2  # bytes from the analog input of a zone to that of the next one


def decoupled_cont_c(source: str, number: int, proof: JointProof) -> str:
    """Return a source of STEP 7 in which OB 35 writes DISV before it calls CONT_C; as it is without decoupling.

    Args:
        source: of one heater.
        number: of the zone.
        proof: of all zones together.
    """
    if proof.design.decoupling is None:
        return source
    body = "\n".join(_disv_statements(number, proof))
    source = _once(r"(      CALL  FB 41 , DB 41 \(\n           COM_RST := FALSE,)", rf"{body}\n\1", source)
    source = _once(r"(  manual : BOOL ;\n)", r"\1  near : INT ;\n", source)
    remark = f"// {_remark(number, proof)}; put the addresses of their inputs in FB 102, too"
    return _once(r"(// verdict of the proof)", rf"{remark}\n\1", source)


def _disv_statements(number: int, proof: JointProof) -> Iterator[str]:
    words = proof.words[number]
    low = [f"      L     {LEAST};  // 3.6 mA", "      <I    ;"] if words.scaling.input == FOUR_TO_TWENTY else [
        "      L     -32768;", "      ==I   ;"]
    yield from (f"      L     {real(0.0)};", f"      T     {_DISV};  // power for the neighbours' temperatures")
    for other, factor, reference in neighbours_in(decoupling_arrays(proof.design.decoupling, proof.words), number):
        end, address = f"nb{other + 1}", 256 + _TICK * other
        yield from (
            f"      L     PIW{address:4d};  // zone {other + 1}", "      T     #near;", "      L     32767;",
            "      ==I   ;", f"      JC    {end};", "      L     #near;", *low, f"      JC    {end};",
            "      L     #near;", "      ITD   ;", "      DTR   ;", f"      L     {real(reference)};", "      -R    ;",
            f"      L     {real(factor)};", "      *R    ;", f"      L     {_DISV};", "      +R    ;",
            f"      T     {_DISV};", f"{end}:  NOP   0;")


def decoupled_text(source: str, number: int, proof: JointProof) -> str:
    """Return a source of structured text that adds power around the block; as it is without decoupling.

    Args:
        source: of one heater.
        number: of the zone.
        proof: of all zones together.
    """
    if proof.design.decoupling is None:
        return source
    words, zones = proof.words[number], proof.fitted.network.zones
    low, high = (literal(single(end)) for end in words.scaling.sensor_degC)
    variables, sums = "", "HeaterAdded := 0.0; (* for the temperatures of the neighbours whose sensors are well *)\n"
    for other, factor, reference in neighbours_in(decoupling_arrays(proof.design.decoupling, proof.words), number):
        name = f"HeaterZone{other + 1}"
        variables += (f"  {name} : REAL := {literal(reference)}; (* degC, temperature of zone {zones[other]}, from its "
                      f"input module *)\n  {name}Good : BOOL := FALSE; (* its sensor is well *)\n")
        sums += (f"IF {name}Good AND {name} >= {low} AND {name} <= {high} THEN\n"
                 f"  HeaterAdded := HeaterAdded + ({name} - ({literal(reference)})) * ({literal(factor)});\nEND_IF;\n")
    variables += "  HeaterAdded : REAL := 0.0; (* power for the neighbours' temperatures, % *)\n"
    sums = re.sub("^", "  ", sums, flags=re.MULTILINE).rstrip(" ")
    for pattern, changed in (
            (r"(  HeaterPid : HT_IEC_PID;\n)", rf"{variables}\1"),
            (r"(  HeaterPid\(\n)", rf"{sums}\1"),
            (r"X0 := HandPower", "X0 := HandPower - HeaterAdded"),
            (r"XMIN := (.+),", r"XMIN := \1 - HeaterAdded,"), (r"XMAX := (.+),", r"XMAX := \1 - HeaterAdded,"),
            (r"HeaterPower := HeaterPid.XOUT;", "HeaterPower := HeaterPid.XOUT + HeaterAdded;"),
            (r"(\(\* verdict of the proof)", rf"(* {_remark(number, proof)} *)\n\1"),
            (r"(PROGRAM Heater)", rf"(*   {_TEXT_STEP} *)\n\1")):
        source = _once(pattern, changed, source)
    return source


_TEXT_STEP: Final = ("wire HeaterZone1, HeaterZone2 ... to the temperatures of these zones, read in the same scan; "
                     "HeaterZone1Good ... must fall when that sensor breaks")


def _remark(number: int, proof: JointProof) -> str:
    """Return what the program adds, a line."""
    decoupling, zones = proof.design.decoupling, proof.fitted.network.zones
    assert decoupling is not None
    parts = [f"{factor:+.4g} % per degC of zone {zones[other]} above {decoupling.references_degC[other]:g} degC"
             for other, factor in enumerate(decoupling.pct_per_degC[number]) if factor != 0.0]
    return f"decoupled: {', '.join(parts) or 'nothing'}"


def _once(pattern: str, changed: str, text: str) -> str:
    text, count = re.subn(pattern, changed, text)
    if count != 1:
        raise InputError("the program of this controller has no place for decoupling: leave out --decouple, and "
                         "--pwm-rule and --pwm-period where they are stated")
    return text
