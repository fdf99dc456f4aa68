"""How the heater is switched: by a PWM block of the export's own, by FB43 PULSEGEN, or behind an analog output.

OB35 ticks at the resolution of the PWM that was proven; every so many ticks it calls the controller.
"""

from __future__ import annotations

from typing import Final, NamedTuple

from heatertune.plc.cpu.s7_300 import awl
from heatertune.plc.cpu.s7_300.cells import BlockMember, values
from heatertune.plc.cpu.s7_300.hardware import FULL_SCALE
from heatertune.plc.pwm import Actuator, pulse_ends
from heatertune.plc.ramp import Number
from heatertune.plc.single_precision import real_of, word_of
from heatertune.plc.words import Certificate, Words

__all__ = ["ANALOG", "OWN", "PULSEGEN", "PwmSource", "like", "pwm_block", "pwm_members", "pwm_source"]

#: who makes the pulses: a block of this source, FB43 of the Standard Library, or the user behind an analog output
OWN: Final = "own"
PULSEGEN: Final = "pulsegen"
ANALOG: Final = "analog"

#: interval of OB35 that an INT holds, as OB35_EXC_FREQ and TICK_MS are [ms]
_SLOWEST: Final = 32767
#: ticks of a period whose product with an analog value fits into 32 bits
_MOST_TICKS: Final = 77000
#: LMN in parts of a percent, and these in twelve bits and the rest: so a product with the ticks fits into 32 bits
_PARTS: Final = 65536
_LOW_BITS: Final = 12

_VARIABLES: Final = """\
VAR_INPUT
  POWER : {type} ;  // {range}
END_VAR
VAR_OUTPUT
  HEAT : BOOL ;
END_VAR
VAR
  PERIOD : DINT ;  // ticks
  LEAST : {type} ;  // POWER below it: no pulse
  MOST : {type} ;  // POWER above it: no pause
  TICK : DINT ;  // of the period, from 0 on
  COUNT : DINT ;  // ticks on in this period
END_VAR"""
_OF_REALS: Final = """\
VAR_TEMP
  share : REAL ;
  rest : REAL ;
  whole : DINT ;
  high : DINT ;
  low : DINT ;
END_VAR"""

_STATEMENTS: Final = """\
NETWORK
TITLE =a period begins: its ticks on, from the power asked for last
      L     #TICK;
      L     L#0;
      >D    ;
      JC    run;
      L     #POWER;
      L     #LEAST;
      >={t}   ;
      JC    some;
      L     L#0;
      JU    have;
some: L     #POWER;
      L     #MOST;
      <={t}   ;
      JC    part;
      L     #PERIOD;
      JU    have;
{count}
have: T     #COUNT;
NETWORK
TITLE =on in the first ticks of a period
run:  L     #TICK;
      L     #COUNT;
      <D    ;
      =     #HEAT;
      L     #TICK;
      L     L#1;
      +D    ;
      T     #TICK;
      L     #PERIOD;
      <D    ;
      JC    end;
      L     L#0;
      T     #TICK;
end:  NOP   0;"""

_COUNT_OF_INTS: Final = f"""\
part: L     #POWER;
      ITD   ;
      L     #PERIOD;
      *D    ;
      L     L#{FULL_SCALE // 2};
      +D    ;
      L     L#{FULL_SCALE};
      /D    ;"""

_COUNT_OF_REALS: Final = f"""\
part: L     #POWER;
      L     {awl.real(_PARTS)};
      *R    ;
      T     #share;  // no rounding: a power of 2
      TRUNC ;
      T     #whole;
      DTR   ;
      T     #rest;
      L     #share;
      L     #rest;
      -R    ;
      L     #PERIOD;
      DTR   ;
      *R    ;
      TRUNC ;
      T     #low;  // ticks times what TRUNC cut off
      L     #whole;
      SRD   {_LOW_BITS};
      L     #PERIOD;
      *D    ;
      T     #high;
      L     L#{100 * _PARTS >> _LOW_BITS};
      /D    ;
      T     #COUNT;
      L     #high;
      L     L#{100 * _PARTS >> _LOW_BITS};
      MOD   ;
      L     L#{1 << _LOW_BITS};
      *D    ;
      L     #low;
      +D    ;
      T     #low;
      L     #whole;
      L     DW#16#{(1 << _LOW_BITS) - 1:X};
      AD    ;
      L     #PERIOD;
      *D    ;
      L     #low;
      +D    ;
      L     L#{50 * _PARTS};
      +D    ;
      L     L#{100 * _PARTS};
      /D    ;
      L     #COUNT;
      +D    ;"""


class PwmSource(NamedTuple):
    """The clock of the program, and what its pulses are made with.

    Attributes:
        by: `OWN`, `PULSEGEN` or `ANALOG`.
        tick_ms: interval of OB35 [ms].
        per_call, per_period: ticks from one call of the controller to the next, and in a period of the PWM.
        least, most: smallest output with a pulse, and largest one with a pause [units of the output].
        shortest_ms: P_B_TM of PULSEGEN [ms].
        why: why there is no PWM in the program; empty where there is one.
    """

    by: str
    tick_ms: int
    per_call: int = 1
    per_period: int = 1
    least: Number = 0
    most: Number = 0
    shortest_ms: int = 0
    reason: str = ""


def pwm_source(words: Words, certificate: Certificate, *, real: bool) -> PwmSource:
    """Return how the program switches what was proven.

    Args:
        words: called every TA.
        certificate: with the switch of the proof.
        real: whether the controller's output is a REAL in percent, and not 0…27648.
    """
    actuator = certificate.actuator
    if actuator is None:
        return _analog(words, "no switch is known of the proof")
    ticks, tick_ms = actuator.ticks(words.sample_time_s), _milliseconds(actuator.resolution_s)
    if ticks is None or tick_ms is None or min(ticks) < 1 or ticks.per_period > _MOST_TICKS:
        return _analog(words, "its times are no whole ticks of OB 35")
    if actuator.block == PULSEGEN:
        shortest = max(tick_ms, round(1000.0 * actuator.minimum_on_s))
        return PwmSource(PULSEGEN, tick_ms, *ticks, shortest_ms=shortest)
    if actuator.minimum_rule != "drop":
        return _analog(words, "its rule makes up what is left out")
    return PwmSource(OWN, tick_ms, *ticks, *_ends(actuator, real=real))


def like(words: Words, by: str) -> PwmSource:
    """Return any switching by these means, for a comparison of statements alone."""
    return _analog(words, "")._replace(by=by)


def pwm_block(number: int, data: int, switch: PwmSource, *, real: bool) -> list[str]:
    """Return the source of the PWM's function block and its instance."""
    kind = "REAL" if real else "INT"
    declared = _VARIABLES.format(type=kind, range="% of full power" if real else f"0..{FULL_SCALE}")
    body = _STATEMENTS.format(t=kind[0], count=_COUNT_OF_REALS if real else _COUNT_OF_INTS)
    return [
        f"FUNCTION_BLOCK FB {number}", "TITLE =PWM of the heater, called each tick: nearest count, halves up",
        "VERSION : 0.1",
        *declared.splitlines(), *(_OF_REALS.splitlines() if real else []), "BEGIN", *body.splitlines(),
        "END_FUNCTION_BLOCK", "",
        f"DATA_BLOCK DB {data}", "TITLE =instance of the heater's PWM", "VERSION : 0.1", f"FB {number}", "BEGIN",
        *values(pwm_members(switch, real=real)), "END_DATA_BLOCK", "",
    ]


def pwm_members(switch: PwmSource, *, real: bool) -> list[BlockMember]:
    """Return the members of the PWM's instance."""
    kind = "REAL" if real else "INT"
    return [
        BlockMember("POWER", kind, 0, ""), BlockMember("HEAT", "BOOL", 0, ""),
        BlockMember("PERIOD", "DINT", switch.per_period, ""),
        BlockMember("LEAST", kind, switch.least, ""), BlockMember("MOST", kind, switch.most, ""),
        BlockMember("TICK", "DINT", 0, ""),
        BlockMember("COUNT", "DINT", 0, ""),
    ]


def _analog(words: Words, why: str) -> PwmSource:
    ms = max(1, round(1000.0 * words.sample_time_s))
    per_call = next(ticks for ticks in range(-(-ms // _SLOWEST), ms + 1) if ms % ticks == 0)
    return PwmSource(ANALOG, ms // per_call, per_call, reason=why)


def _milliseconds(seconds: float) -> int | None:
    """Return an interval that OB35 can have and tell [ms], None for another."""
    ms = round(1000.0 * seconds)
    return ms if 1 <= ms <= _SLOWEST and abs(ms - 1000.0 * seconds) < 1e-6 else None


def _ends(actuator: Actuator, *, real: bool) -> tuple[Number, Number]:
    """Return the smallest output with a pulse and the largest with a pause."""
    if not real:
        return pulse_ends(actuator, lambda counts: 100.0 * counts / FULL_SCALE, FULL_SCALE)
    least, most = pulse_ends(actuator, real_of, word_of(100.0))
    return real_of(least), real_of(most)
