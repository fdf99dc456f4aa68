"""CONT_C's words as STL source with the whole program, as CSV with offsets, and as the CPU holds them; read back.

The exported program runs in the emulated CPU; CONT_C itself, part of STEP 7, uses the model of the proof. Feed-forward
goes to DISV [% of LMN], which CONT_C adds before the limits: LMN = P + I + D + DISV.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Mapping
from dataclasses import replace
from typing import Any, Final

from heatertune.errors import InputError
from heatertune.plc.cpu.s7_300 import machine
from heatertune.plc.cpu.s7_300 import source as awl
from heatertune.plc.cpu.s7_300.exported_blocks import ExportedS7
from heatertune.plc.cpu.s7_300.machine import FULL_SCALE, S7300Cpu, clamp, quotient, real
from heatertune.plc.cpu.s7_300.program import (
    PULSEGEN,
    BlockProgram,
    PwmSource,
    by_hand,
    counts_of,
    like,
    pwm_source,
    whole_number,
)
from heatertune.plc.cpu.s7_300.readback import read_source
from heatertune.plc.cpu.s7_300.source import BlockMember, as_real, bits_of, signed_number
from heatertune.plc.fb41.step import ContCAssumptions, ContCParameters, ContCState, scale_reading, scan
from heatertune.plc.fb41.words import FIELDS, parameters_of, reading_periphery
from heatertune.plc.feed_forward import FeedForward, FeedForwardHooks
from heatertune.plc.firmware.firmware_text import blank_matches
from heatertune.plc.ramp import Number
from heatertune.plc.readback import PastedNames, ReadBack, WordCollector, put_pasted, unread_lines
from heatertune.plc.single_precision import single
from heatertune.plc.words import FORMATS, Certificate, Words

__all__ = [
    "FEED", "export_words", "from_image", "from_text", "loaders", "oddities", "premises", "setpoint_entry", "source",
]


_FILE: Final = "fb41_cont_c.awl"
_EXPORTED_LMN: Final = slice(72, 76)
_REALS: Final = frozenset(field.name for field in FIELDS if field.format == "REAL")


class ExportedContC(ExportedS7):
    """See `heatertune.plc.exported.ExportedInPlc`."""

    def __init__(self, source: str, assume: ContCAssumptions) -> None:
        """Load a source; raise InputError where the source has what the CPU does not know."""
        self._assume, self._state = assume, ContCState()
        self._held: tuple[int, ...] = ()
        super().__init__(source, {"FB 41": self._cont_c})

    def setpoint_bits(self, counts: int) -> int:
        """Return an analog value, which a ramp takes, or what it means in the unit of PV."""
        if self._led is not None:
            return counts
        return bits_of(scale_reading(parameters_of(_values(self._cpu.words["DB 41"])), counts)[0])

    def outcome(self) -> tuple[Number, float]:
        """Return LMN, and it within 0…100 %."""
        lmn = as_real(int.from_bytes(self._cpu.memory["DB 41"][_EXPORTED_LMN], "big"))
        return lmn, clamp(lmn, 0.0, 100.0)

    def force(self, output: Number) -> None:
        """Write LMN."""
        self._cpu.memory["DB 41"][_EXPORTED_LMN] = bits_of(output).to_bytes(4, "big")

    def _cont_c(self, _cpu: S7300Cpu, words: dict[str, int]) -> None:
        if not words["PVPER_ON"]:
            raise InputError("FB 41: PVPER_ON is FALSE; so it reads PV_IN, and no analog value")
        values = tuple(words[field.name] for field in FIELDS)
        if values != self._held:
            self._held, self._parameters = values, parameters_of(_values(words))
        inputs = {"COM_RST": words["COM_RST"], "MAN_ON": words["MAN_ON"],
                  "PV_PER": signed_number(words.get("PV_PER", 0), 16), "SP_INT": as_real(words.get("SP_INT", 0))}
        self._state, _, lmn, _ = scan((self._parameters, self._assume), self._state, inputs)
        self.force(lmn)


def _values(words: Mapping[str, int]) -> dict[str, Number]:
    return {field.name: as_real(words[field.name]) if field.name in _REALS else words[field.name] for field in FIELDS}


def loaders(files: Mapping[str, str | bytes], assume: ContCAssumptions) -> dict[str, Callable[[], ExportedContC]]:
    """Return the function that loads the source."""
    return {_FILE: lambda: ExportedContC(str(files[_FILE]), assume)}


_WRONG_CLOCK: Final = 1e-6


def from_image(image: bytes, _sample_time_s: float, source: str) -> dict[str, Number]:
    """Return the values in a dumped instance data block of at least 72 bytes; after DISV follow outputs and statics.

    Raises:
        InputError: fewer than 72 bytes.
    """
    return machine.read(image, FIELDS, source)


def oddities(words: Words) -> tuple[str, ...]:
    """Return the oddities of a controller's words, one sentence each."""
    v, call_ms = words.values, 1000.0 * words.sample_time_s
    half = v["CYCLE"] / 2.0
    checks = [
        (abs(v["CYCLE"] - call_ms) > _WRONG_CLOCK * call_ms,
         f"CYCLE is {v['CYCLE']} ms, but the block is called every {call_ms:g} ms: all times are "
         f"{call_ms / v['CYCLE']:.3g} times what the words say."),
        (not v["PVPER_ON"], "PVPER_ON is 0: the reading is PV_IN, taken to be in °C; if it has another unit, write "
         "PVPER_ON := TRUE, PV_FAC := its units per percent of --range, PV_OFF := its value at the lower end."),
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


_DISV: Final = "DB41.DBD   68"


def _listened(values: Mapping[str, Number]) -> Mapping[str, Number]:
    return values


def _with_input(parameters: tuple[ContCParameters, ContCAssumptions], value: Number) -> tuple[Any, ContCAssumptions]:
    return parameters[0]._replace(disturbance=single(value)), parameters[1]


def _listing(line: FeedForward, certificate: Certificate) -> dict[str, str]:
    head = [
        f"FC 41 writes DISV of DB 41: {line.pct_per_unit:+.4g} % of full power per unit of {line.column}",
        f"DISV = {line.at_low:.6g} % at {line.low:g}, {line.at_high:.6g} % at {line.high:g}; about 0 at {line.calm:g}",
        "in OB 35 write CALL FC 41 before CALL FB 41, whose own parameter DISV stays empty", *certificate.head,
        "STL source, international mnemonics; not tried in STEP 7",
    ]
    body = _contact(line) if line.switched else _analog(line)
    return {"feed_forward.awl": awl.text([
        *(f"// {text}" for text in head), "FUNCTION FC 41 : VOID", "TITLE =disturbance variable of the controller",
        "VERSION : 0.1", "BEGIN", "NETWORK", "TITLE =tie this to your input", *body, f"      T     {_DISV};",
        "END_FUNCTION"])}


def _contact(line: FeedForward) -> list[str]:
    return ["      A     I      1.0;", "      JC    shut;", f"      L     {awl.real(line.at_low)};", "      JU    end;",
            f"shut: L     {awl.real(line.at_high)};", "end:  NOP   0;"]


def _analog(line: FeedForward) -> list[str]:
    factor = single((line.at_high - line.at_low) / FULL_SCALE)
    return ["      L     PIW  258;", "      ITD   ;", "      DTR   ;", f"      L     {awl.real(factor)};",
            "      *R    ;", f"      L     {awl.real(line.at_low)};", "      +R    ;"]


FEED: Final = FeedForwardHooks(
    word="DISV", per_pct=1.0, most=FORMATS["REAL"][1], whole=False, listened=_listened, set_disturbance=_with_input,
    listing=_listing)


_DB: Final = 41
_LMN: Final = f"DB{_DB}.DBD   72"


def export_words(words: Words, certificate: Certificate) -> dict[str, str | bytes]:
    """Return source and table; the same words and certificate give the same bytes.

    FB41 itself is not part of the source: it comes with STEP 7 (Standard Library, PID Control Blocks).
    """
    words = replace(words, values=reading_periphery(words.values, words.scaling))
    return {"fb41_cont_c.awl": _source(words, certificate, pwm_source(words, certificate, real=True)),
            "fb41_words.csv": awl.table(FIELDS, words)}


def source(words: Words, by: str) -> str:
    """Return the source of words whose heater is switched by these means, for a comparison of statements alone."""
    return _source(words, Certificate(verdict=""), like(words, by))


def _source(words: Words, certificate: Certificate, switch: PwmSource) -> str:
    low, factor = words.values["PV_OFF"], words.values["PV_FAC"]
    setpoint_text = "SP in degC" if words.ramp is None else (
        f"SP = {FULL_SCALE}/100 * (degC {0.0 - low:+g})/{factor:g}, {whole_number(words)}: OB 35 leads SP_INT there"
    )
    library = "FB 41 must be in the program" if switch.by != PULSEGEN else "FB 41 and FB 43 must be in the program"
    head = awl.head(
        "instance of CONT_C (FB 41; on a CPU 31xC write SFB 41 for FB 41)", words, certificate,
        f"PV = PV_PER * 100/{FULL_SCALE} * {factor:g} + {low:g}, in degC; {setpoint_text}",
        *by_hand(words, certificate, switch, f"{library}: Standard Library, PID Control Blocks"),
    )
    program = _program(words, certificate, switch)
    return awl.text([*head, *_data_block(words), *program.blocks, *program.restart([]), *program.interrupt])


def _program(words: Words, certificate: Certificate, switch: PwmSource) -> BlockProgram:
    return BlockProgram(
        input=words.scaling.input,
        real=True, setpoint=_setpoint(words, certificate), output=_LMN, word=f"DB{_DB}.DBW   76", ramp=words.ramp,
        switch=switch, temporaries=("raw : WORD", "manual : BOOL", *(() if words.ramp is None else ("led : REAL",))),
        begins=[f"      CALL  FB {_DB} , DB {_DB} (", "           COM_RST := TRUE);"],
        manual=lambda _: [],
        call=lambda at: [
            *_led(words, at["LED"] if words.ramp is not None else ""),
            "      L     #reading;", "      T     #raw;", f"      AN    {at['AUTO']};", "      =     #manual;",
            f"      CALL  FB {_DB} , DB {_DB} (", "           COM_RST := FALSE,", "           MAN_ON := #manual,",
            f"           SP_INT := {at['SP'] if words.ramp is None else '#led'},", "           PV_PER := #raw,",
            f"           MAN := {at['POWER']});",
        ])


def _setpoint(words: Words, certificate: Certificate) -> BlockMember:
    """Return the setpoint as the proof had it: an analog value, which a ramp takes as it is, and the block in °C."""
    low, proven = words.scaling.low_degC, certificate.setpoint_degC
    counts = counts_of(words, low if proven is None else proven)
    if words.ramp is not None:
        return BlockMember("SP", "INT", counts, f"setpoint, yours: 0..{FULL_SCALE}")
    share = quotient(real(counts * 100.0)[0], FULL_SCALE)[0]
    scaled = real(real(share * words.values["PV_FAC"])[0] + words.values["PV_OFF"])[0]
    return BlockMember("SP", "REAL", scaled, "setpoint, yours: degC")


def _data_block(words: Words) -> list[str]:
    values = [
        f"  {f.name} := {awl.literal(f.format, words.values[f.name])} ;  // {f.address}: {f.comment}" for f in FIELDS
    ]
    return [
        f"DATA_BLOCK DB {_DB}", "TITLE =instance of the heater's controller", "VERSION : 0.1", "FB 41", "BEGIN",
        "  COM_RST := FALSE ;", *values, "END_DATA_BLOCK", "",
    ]


def _led(words: Words, led: str) -> list[str]:
    """Return the statements that make °C of the setpoint on its ramp, by the operations that make PV of PV_PER."""
    if words.ramp is None:
        return []
    factor, low = (awl.real(words.values[name]) for name in ("PV_FAC", "PV_OFF"))
    return [
        f"      L     {led};", "      ITD   ;", "      DTR   ;", f"      L     {awl.real(100.0)};", "      *R    ;",
        f"      L     {awl.real(FULL_SCALE)};", "      /R    ;", f"      L     {factor};", "      *R    ;",
        f"      L     {low};", "      +R    ;", "      T     #led;",
    ]


def setpoint_entry(words: Words, setpoint_degC: float, _units: int) -> str:
    """Return the setpoint as a person enters it, see `heatertune.plc.controller.Controller`."""
    value = _setpoint(words, Certificate(verdict="", setpoint_degC=setpoint_degC)).value
    return f"SP (DBD 2 of DB 101) = {value:.9g} °C" if words.ramp is None else f"SP (DBW 2 of DB 101) = {value}"


_DATA_BLOCK: Final = re.compile(r"^\s*(?:(?:END_)?DATA_BLOCK|BEGIN)\b", re.IGNORECASE | re.MULTILINE)
_COMMENT: Final = re.compile(r"\(\*.*?(?:\*\)|\Z)|//[^\r\n]*", re.DOTALL)
_SECONDS: Final = dict.fromkeys(("CYCLE", "TI", "TD", "TM_LAG"), 0.001)
_NEEDED: Final = {"GAIN": "GAIN = 2.0", "TI": "TI = T#20s"}
#: what the block starts with, but for MAN_ON: somebody who asks about a loop has it in automatic
DEFAULTS: Final[Mapping[str, Number]] = {
    "MAN_ON": 0, "PVPER_ON": 0, "P_SEL": 1, "I_SEL": 1, "INT_HOLD": 0, "I_ITL_ON": 0, "D_SEL": 0, "CYCLE": 1000,
    "MAN": 0.0, "TD": 10000, "TM_LAG": 2000, "DEADB_W": 0.0, "LMN_HLM": 100.0, "LMN_LLM": 0.0, "PV_FAC": 1.0,
    "PV_OFF": 0.0, "LMN_FAC": 1.0, "LMN_OFF": 0.0, "I_ITLVAL": 0.0, "DISV": 0.0,
}
#: switch that is off → what then changes nothing
_IDLE: Final = {"D_SEL": ("TD", "TM_LAG"), "PVPER_ON": ("PV_FAC", "PV_OFF"), "MAN_ON": ("MAN",)}
#: a wire at the input that is read with PVPER_ON
_PERIPHERY: Final = re.compile(r"\bPV_PER\s*:?=\s*[^\s,;)]", re.IGNORECASE)


def from_text(text: str, sample_time_s: float | None, origin: str) -> ReadBack:
    """Return the words in the source of CONT_C's instance data block, in a call, or in a list as a thread shows it.

    A parameter that a data block leaves out is missing; a call or list leaves out what has the block's own default,
    and MAN_ON, whose default is TRUE, where it shows a loop in automatic mode.

    Raises:
        InputError: as `read_source` and `put_pasted`; a call that leaves open whether D acts or where the reading is.
    """
    if _DATA_BLOCK.search(text):
        return read_source(text, FIELDS, origin, source)
    vocabulary, collected = PastedNames(FIELDS, {"Kp": "GAIN"}, _SECONDS, block="CONT_C"), WordCollector(origin, FIELDS)
    plain = blank_matches(_COMMENT, text)
    put_pasted(collected, plain, vocabulary, _NEEDED, origin)
    for name, is_open in (("D_SEL", "TD" in collected), ("PVPER_ON", _PERIPHERY.search(plain) is not None)):
        if is_open and name not in collected:
            raise InputError(f"{origin}: no {name}; expected a line {name} := TRUE or {name} := FALSE")
    if sample_time_s is not None:
        collected.assume({"CYCLE": round(1000.0 * sample_time_s)})
    assumed = tuple(f"{each} (automatic mode; the block's own default is TRUE)" if each.startswith("MAN_ON") else each
                    for each in collected.assume(DEFAULTS, _IDLE))
    return ReadBack(collected.values(), unread_lines(plain, vocabulary), assumed=assumed)


def premises(words: Words) -> tuple[str, ...]:
    """Return what words leave to the program that calls the block."""
    return () if words.values["PVPER_ON"] else ("PV_IN, SP_INT and DEADB_W are in °C",)
