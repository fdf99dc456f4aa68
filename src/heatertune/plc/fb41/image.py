"""CONT_C's instance data block as a running CPU holds it."""

from __future__ import annotations

from typing import Final

from heatertune.plc.cpu.s7_300 import memory
from heatertune.plc.fb41.words import FIELDS
from heatertune.plc.ramp import Number
from heatertune.plc.words import Words

__all__ = ["from_image", "oddities"]

_WRONG_CLOCK: Final = 1e-6


def from_image(image: bytes, _sample_time_s: float, source: str) -> dict[str, Number]:
    """Return the values in a dumped instance data block of at least 72 bytes; after DISV follow outputs and statics.

    Raises:
        InputError: fewer than 72 bytes.
    """
    return memory.read(image, FIELDS, source)


def oddities(words: Words) -> tuple[str, ...]:
    """Return what is odd about a controller's words, one sentence each."""
    v, called = words.values, 1000.0 * words.sample_time_s
    half = v["CYCLE"] / 2.0
    checks = [
        (abs(v["CYCLE"] - called) > _WRONG_CLOCK * called,
         f"CYCLE is {v['CYCLE']} ms, but the block is called every {called:g} ms: all times are "
         f"{called / v['CYCLE']:.3g} times what the words say."),
        (v["MAN_ON"], "MAN_ON is 1: the controller is in manual, LMN is MAN."),
        (not v["P_SEL"] or v["GAIN"] == 0.0, "P_SEL or GAIN is 0: there is no proportional part."),
        (not v["I_SEL"], "I_SEL is 0: there is no integral part."),
        (v["I_SEL"] and v["INT_HOLD"], "INT_HOLD is 1: the integral part stands still."),
        (v["I_SEL"] and v["I_ITL_ON"], "I_ITL_ON is 1: the integral part is I_ITLVAL for ever."),
        (v["I_SEL"] and v["TI"] < half, f"TI is {v['TI']} ms: the block raises it to half a CYCLE."),
        (v["D_SEL"] and v["TD"] < v["CYCLE"], f"TD is {v['TD']} ms: the block raises it to CYCLE."),
        (v["D_SEL"] and v["TM_LAG"] < half, f"TM_LAG is {v['TM_LAG']} ms: the block raises it to half a CYCLE."),
        (v["DEADB_W"] > 0.0, f"DEADB_W is {v['DEADB_W']:g}: inside it the temperature drifts."),
        ((v["LMN_LLM"], v["LMN_HLM"]) != (0.0, 100.0),
         f"LMN is limited to {v['LMN_LLM']:g}…{v['LMN_HLM']:g} %, not to 0…100 %."),
        ((v["LMN_FAC"], v["LMN_OFF"]) != (1.0, 0.0), "LMN_FAC and LMN_OFF change the output: it is not in %."),
        (v["GAIN"] * v["PV_FAC"] < 0.0, "the gain is negative: the output falls where the temperature is too low."),
    ]
    return tuple(sentence for is_odd, sentence in checks if is_odd)
