"""The tip's PID as STL source with the whole program, its four words as CSV and as the CPU holds them; read back.

The function block is `step.call`, one instruction per operation. The listing of the document is lost, so this one is
heatertune's own; interface and addresses of the four words are the document's. The program runs in the emulated CPU.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Final

from heatertune.plc.cpu.s7_300 import machine
from heatertune.plc.cpu.s7_300 import source as awl
from heatertune.plc.cpu.s7_300.exported_blocks import ExportedS7
from heatertune.plc.cpu.s7_300.machine import FULL_SCALE
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
from heatertune.plc.cpu.s7_300.source import BlockMember, real
from heatertune.plc.ramp import Number
from heatertune.plc.readback import ReadBack
from heatertune.plc.s7_300.step import PidTipAssumptions, percent
from heatertune.plc.s7_300.words import FIELDS
from heatertune.plc.words import Certificate, Words

__all__ = [
    "STATEMENTS", "VARIABLES", "export_words", "from_image", "from_text", "loaders", "oddities", "setpoint_entry",
    "source",
]


_FILE: Final = "s7_300_pid.awl"
_EXPORTED_OUT: Final = slice(6, 8)


class _Exported(ExportedS7):
    def setpoint_bits(self, counts: int) -> int:
        return counts

    def outcome(self) -> tuple[Number, float]:
        output = int.from_bytes(self._cpu.memory["DB 100"][_EXPORTED_OUT], "big", signed=True)
        return output, percent(output)

    def force(self, output: Number) -> None:
        self._cpu.memory["DB 100"][_EXPORTED_OUT] = int(output).to_bytes(2, "big", signed=True)


def loaders(files: Mapping[str, str | bytes], assume: PidTipAssumptions) -> dict[str, Callable[[], ExportedS7]]:
    """Return the loader of the source; nothing for other assumptions than its own: the text is one of several."""
    return {_FILE: lambda: _Exported(str(files[_FILE]), {})} if assume == PidTipAssumptions() else {}


_WRONG_CLOCK: Final = 1e-6
#: times that no heater needs [ms]: a day, and less than a tenth of a call
_DAY: Final = 86_400_000.0


def from_image(image: bytes, _sample_time_s: float, source: str) -> dict[str, Number]:
    """Return the values in a dumped instance data block of at least 26 bytes; what follows belongs to the block.

    An infinite RESET is read as 0: the document means the same by both.

    Raises:
        InputError: fewer than 26 bytes.
    """
    values = machine.read(image, FIELDS, source)
    if values["RESET"] == math.inf:
        values["RESET"] = 0.0
    return values


def oddities(words: Words) -> tuple[str, ...]:
    """Return the oddities of a controller's words, one sentence each."""
    v, call_ms = words.values, 1000.0 * words.sample_time_s
    odd = []
    if abs(v["SAMPLE"] - call_ms) > _WRONG_CLOCK * call_ms:
        odd.append(f"SAMPLE is {v['SAMPLE']:g} ms, but the block is called every {call_ms:g} ms: TN and TV are "
                   f"{call_ms / v['SAMPLE']:.3g} times what RESET and RATE say.")
    if v["GAIN"] == 0.0:
        odd.append("GAIN is 0: no proportional part; the integral and derivative parts act with a gain of 1.")
    elif v["GAIN"] < 0.0:
        odd.append("GAIN is negative: the output falls where the temperature is too low, as for a cooler.")
    if v["RESET"] == 0.0:
        odd.append("RESET is 0 (or infinite): the controller has no integral part.")
    elif not v["SAMPLE"] <= v["RESET"] <= _DAY:
        odd.append(f"RESET is {v['RESET']:g} ms: shorter than one call or longer than a day; is it in ms?")
    if v["RATE"] and not v["SAMPLE"] / 10.0 <= v["RATE"] <= _DAY:
        odd.append(f"RATE is {v['RATE']:g} ms: shorter than a tenth of a call or longer than a day; is it in ms?")
    return tuple(odd)


_FULL: Final = real(FULL_SCALE)
_ZERO: Final = real(0.0)
_ONE: Final = real(1.0)

#: ten bytes stand before GAIN, so that the words lie at DBD10, 14, 18 and 22
VARIABLES: Final = """\
VAR_INPUT
  mode_req : BOOL ;  // FALSE manual, TRUE automatic
  PV : INT ;         // reading, 0..27648
  SP : INT ;         // setpoint, 0..27648
END_VAR
VAR_OUTPUT
  OUT : INT ;        // 0..27648; in manual the user writes DBW 6
  OVERFLOW : BOOL ;  // a REAL result was no normal number
END_VAR
VAR
  GAIN : REAL ;
  RATE : REAL ;      // ms
  RESET : REAL ;     // ms; 0: no integral part
  SAMPLE : REAL ;    // ms
  BIAS : REAL ;
  PV_LAST : REAL ;
  STARTED : BOOL ;
END_VAR
VAR_TEMP
  pv_n : REAL ;
  error_n : REAL ;
  factor : REAL ;
  gain_i : REAL ;
  gain_d : REAL ;
  mp : REAL ;
  mi : REAL ;
  md : REAL ;
  other : REAL ;
  result : REAL ;
END_VAR"""


def _clamp(name: str, label: str) -> str:
    """Return a clamp to 0..1 after which what is not a number is 0."""
    return f"""\
      L     #{name};
      L     {_ONE};
      >R    ;
      JC    {label}1;
      L     #{name};
      L     {_ZERO};
      >R    ;
      JC    {label}2;
      L     {_ZERO};
      T     #{name};
      JU    {label}2;
{label}1:  L     {_ONE};
      T     #{name};
{label}2:  NOP   0;"""


def _normalised(source: str, target: str) -> str:
    return f"""\
      L     #{source};
      ITD   ;
      DTR   ;
      L     {_FULL};
      /R    ;
      T     #{target};"""


STATEMENTS: Final = f"""\
NETWORK
TITLE =clear OS, normalise the reading
      JOS   go;
go:   NOP   0;
{_normalised("PV", "pv_n")}
      A     #mode_req;
      JC    auto;
NETWORK
TITLE =manual: OUT is the user's, BIAS follows it
{_normalised("OUT", "BIAS")}
{_clamp("BIAS", "ma")}
      JU    kept;
NETWORK
TITLE =automatic: Error = SP - PV
auto: NOP   0;
{_normalised("SP", "error_n")}
      L     #error_n;
      L     #pv_n;
      -R    ;
      T     #error_n;
      A     #STARTED;
      JC    coef;
      L     #pv_n;
      T     #PV_LAST;
NETWORK
TITLE =CI = Gain * (Sample / Reset), CD = Gain * (Rate / Sample), without Gain where it is 0
coef: L     #GAIN;
      L     {_ZERO};
      <>R   ;
      JC    gain;
      L     {_ONE};
      JU    fact;
gain: L     #GAIN;
fact: T     #factor;
      L     {_ZERO};
      T     #gain_i;
      L     #RESET;
      <>R   ;
      JCN   noi;
      L     #SAMPLE;
      L     #RESET;
      /R    ;
      L     #factor;
      *R    ;
      T     #gain_i;
noi:  L     #RATE;
      L     #SAMPLE;
      /R    ;
      L     #factor;
      *R    ;
      T     #gain_d;
NETWORK
TITLE =MP, MI, MD, Output = MP + MI + MD
      L     #GAIN;
      L     #error_n;
      *R    ;
      T     #mp;
      L     #gain_i;
      L     #error_n;
      *R    ;
      L     #BIAS;
      +R    ;
      T     #mi;
      L     #PV_LAST;
      L     #pv_n;
      -R    ;
      L     #gain_d;
      *R    ;
      T     #md;
      L     #mp;
      L     #mi;
      +R    ;
      L     #md;
      +R    ;
      T     #result;
      L     #mp;
      L     #md;
      +R    ;
      T     #other;
NETWORK
TITLE =bias clamping
      L     #result;
      L     {_ONE};
      >R    ;
      JC    high;
      L     #result;
      L     {_ZERO};
      >=R   ;
      JC    free;
      L     {_ZERO};
      JU    adj;
high: L     {_ONE};
adj:  L     #other;
      -R    ;
      T     #BIAS;
{_clamp("BIAS", "bi")}
      JU    outp;
free: L     #mi;
      T     #BIAS;
NETWORK
TITLE =output clamping, OUT = Output * 27648
outp: NOP   0;
{_clamp("result", "ou")}
      L     #result;
      L     {_FULL};
      *R    ;
      RND   ;
      T     #OUT;
NETWORK
TITLE =what the next call needs
kept: L     #pv_n;
      T     #PV_LAST;
      SET   ;
      S     #STARTED;
      JOS   ovfl;
      R     #OVERFLOW;
      BEU   ;
ovfl: SET   ;
      S     #OVERFLOW;"""


#: number of the function block and of its instance data block: free in most programs
_NUMBER: Final = 100
_OUT: Final = f"DB{_NUMBER}.DBW    6"


def export_words(words: Words, certificate: Certificate) -> dict[str, str | bytes]:
    """Return source and table; the same words and certificate give the same bytes.

    The data block gives every member its value in BEGIN; OB100 loads the four words bit by bit after each restart.
    """
    return {"s7_300_pid.awl": _source(words, certificate, pwm_source(words, certificate, real=False)),
            "s7_300_words.csv": awl.table(FIELDS, words)}


def source(words: Words, by: str) -> str:
    """Return the source of words whose heater is switched by these means, for a comparison of statements alone."""
    return _source(words, Certificate(verdict=""), like(words, by))


def _source(words: Words, certificate: Certificate, switch: PwmSource) -> str:
    low, span = words.scaling.low_degC, words.scaling.span_degC
    pulsegen = ["FB 43 PULSEGEN must be in the program: Standard Library, PID Control Blocks"]
    head = awl.head(
        "PID of S7-300/400 application tip No. 2: the document's equations, heatertune's statements", words,
        certificate, f"setpoint SP = {FULL_SCALE}/{span:g} * (degC {0.0 - low:+g}), {whole_number(words)}",
        *by_hand(words, certificate, switch, *(pulsegen if switch.by == PULSEGEN else [])),
    )
    program = _program(words, certificate, switch)
    return awl.text([*head, *_function_block(), *_data_block(words), *program.blocks,
                     *program.restart(_loads(words)), *program.interrupt])


def _program(words: Words, certificate: Certificate, switch: PwmSource) -> BlockProgram:
    counts = 0 if certificate.setpoint_degC is None else counts_of(words, certificate.setpoint_degC)
    setpoint = "SP" if words.ramp is None else "LED"
    return BlockProgram(
        input=words.scaling.input,
        real=False, setpoint=BlockMember("SP", "INT", counts, f"setpoint, yours: 0..{FULL_SCALE}"), output=_OUT,
        word=_OUT,
        ramp=words.ramp, switch=switch, temporaries=("share : REAL",) if switch.by == PULSEGEN else (),
        begins=[
            f"      L     {awl.bits(0.0)};", f"      T     DB{_NUMBER}.DBD   26;  // BIAS", "      CLR   ;",
            f"      =     DB{_NUMBER}.DBX   34.0;  // STARTED", "      L     0;", f"      T     {_OUT};  // OUT",
        ],
        manual=lambda at: [f"      L     {at['POWER']};", f"      T     {_OUT};"],
        call=lambda at: [
            f"      CALL  FB {_NUMBER} , DB {_NUMBER} (", f"           mode_req := {at['AUTO']},",
            "           PV := #reading,", f"           SP := {at[setpoint]});",
        ])


def _function_block() -> list[str]:
    return [
        f"FUNCTION_BLOCK FB {_NUMBER}", "TITLE =PID, application tip No. 2", "VERSION : 0.1",
        *VARIABLES.splitlines(), "BEGIN", *STATEMENTS.splitlines(), "END_FUNCTION_BLOCK", "",
    ]


def _data_block(words: Words) -> list[str]:
    values = [f"  {f.name} := {awl.real(words.values[f.name])} ;  // {f.address}: {f.comment}" for f in FIELDS]
    return [
        f"DATA_BLOCK DB {_NUMBER}", "TITLE =instance of the heater's PID", "VERSION : 0.1", f"FB {_NUMBER}", "BEGIN",
        "  mode_req := FALSE ;", "  PV := 0 ;", "  SP := 0 ;", "  OUT := 0 ;", "  OVERFLOW := FALSE ;", *values,
        f"  BIAS := {awl.real(0.0)} ;", f"  PV_LAST := {awl.real(0.0)} ;", "  STARTED := FALSE ;", "END_DATA_BLOCK", "",
    ]


def _loads(words: Words) -> list[str]:
    """Return the statements that load the four words."""
    loads = []
    for field in FIELDS:
        value = words.values[field.name]
        loads += [f"      L     {awl.bits(value)};  // {field.name} {value:.9g}",
                  f"      T     DB{_NUMBER}.DBD {field.address.removeprefix('DBD')};"]
    return loads


def setpoint_entry(_words: Words, _setpoint_degC: float, units: int) -> str:
    """Return the setpoint as a person enters it, see `heatertune.plc.controller.Controller`."""
    return f"SP (DBW 2 of DB 101) = {units}"


def from_text(text: str, _sample_time_s: float | None, origin: str) -> ReadBack:
    """Return the words in the source of the block's instance data block; errors as `read_source`."""
    return read_source(text, FIELDS, origin, source)
