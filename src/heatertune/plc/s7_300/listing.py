"""The function block's statements: `algorithm.call`, one instruction per operation.

The listing of the document is lost, so this is heatertune's own; its interface and the places of the four words are the
document's.
"""

from __future__ import annotations

from typing import Final

from heatertune.plc.cpu.s7_300.awl import real
from heatertune.plc.cpu.s7_300.hardware import FULL_SCALE

__all__ = ["STATEMENTS", "VARIABLES"]

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
