"""The program around a controller's block, in STL: restart, clock, broken sensor, setpoint, manual, switch.

OB35 runs at the resolution of the proven PWM; it calls the PWM at each tick and the controller every so many ticks. If
the sensor is broken, or OB35 has another interval than in the proof, the heater is off at once, and the controller
starts afterwards as after a restart.

The heater is switched by a PWM block of the export, by FB43 PULSEGEN, or behind an analog output.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Final, NamedTuple

from heatertune.plc.core import count
from heatertune.plc.cpu.s7_300 import source as awl
from heatertune.plc.cpu.s7_300.machine import FULL_SCALE, RANGES
from heatertune.plc.cpu.s7_300.source import BlockMember, values
from heatertune.plc.inputs import BROKEN_MA, FOUR_TO_TWENTY, INPUTS, has_ends, module, share_of
from heatertune.plc.print.statements import renamed, setpoint_ramp
from heatertune.plc.print.stl import S7300Printer
from heatertune.plc.pwm import Actuator, pulse_ends
from heatertune.plc.ramp import Number, Ramp
from heatertune.plc.single_precision import real_of, word_of
from heatertune.plc.words import Certificate, Words

__all__ = [
    "ANALOG", "DATA", "LEAST", "OWN", "PULSEGEN", "PWM_DATA", "BlockProgram", "PwmSource", "by_hand", "counts_of",
    "like", "pwm_block", "pwm_members", "pwm_source", "whole_number",
]


#: cells of the setpoint ramp in the program's data, words; the others are double words for the time of a call
_RAMP: Final = {"Asked": "SP", "Lead": "LED", "Calls": "COUNTDOWN"}
_RAMP_TEMPORARIES: Final = tuple(f"{name.lower()} : DINT" for name in ("SIZE", "AHEAD", "BACK", "END"))


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
        "VERSION : 0.1", *declared.splitlines(), *(_OF_REALS.splitlines() if real else []), "BEGIN", *body.splitlines(),
        "END_FUNCTION_BLOCK", "", f"DATA_BLOCK DB {data}", "TITLE =instance of the heater's PWM", "VERSION : 0.1",
        f"FB {number}", "BEGIN", *values(pwm_members(switch, real=real)), "END_DATA_BLOCK", "",
    ]


def pwm_members(switch: PwmSource, *, real: bool) -> list[BlockMember]:
    """Return the members of the PWM's instance."""
    kind = "REAL" if real else "INT"
    return [
        BlockMember("POWER", kind, 0, ""), BlockMember("HEAT", "BOOL", 0, ""),
        BlockMember("PERIOD", "DINT", switch.per_period, ""), BlockMember("LEAST", kind, switch.least, ""),
        BlockMember("MOST", kind, switch.most, ""), BlockMember("TICK", "DINT", 0, ""),
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


#: numbers of the program's own blocks, free in most programs: data block, FC that begins anew, PWM and its instance
DATA: Final = 101
_ANEW: Final = 101
_PWM: Final = 101
PWM_DATA: Final = 102
_PULSEGEN: Final = 43

#: analog value of 3.6 mA in the range of 4 to 20 mA
LEAST: Final = round(FULL_SCALE * share_of(BROKEN_MA, RANGES[FOUR_TO_TWENTY]))

#: what the CPU tells an OB at its start: 20 bytes; the interval stands at the tenth
_TOLD: Final = """\
VAR_TEMP
  OB35_EV_CLASS : BYTE ;
  OB35_STRT_INF : BYTE ;
  OB35_PRIORITY : BYTE ;
  OB35_OB_NUMBR : BYTE ;
  OB35_RESERVED_1 : BYTE ;
  OB35_RESERVED_2 : BYTE ;
  OB35_PHASE_OFFSET : WORD ;
  OB35_RESERVED_3 : INT ;
  OB35_EXC_FREQ : INT ;  // ms
  OB35_DATE_TIME : DATE_AND_TIME ;
  reading : INT ;"""


@dataclass(frozen=True, slots=True, kw_only=True)
class BlockProgram:
    """What the program around knows of a controller's block.

    Attributes:
        real: whether its output is a REAL in percent, and not 0…27648.
        setpoint: type, value after loading and meaning of the setpoint that the user enters.
        output: operand of its output, in its instance.
        word: operand of the same as an analog value.
        begins: statements after which it begins from cold.
        manual: operands of the program's data → statements of a call in manual, before the call.
        call: operands of the program's data → statements of a call, with the reading in #reading.
        temporaries: what the statements need beside it, declarations.
        ramp: of the setpoint; None: none.
        switch: how the heater is switched.
        input: range of the analog module, see `heatertune.plc.inputs`.
    """

    real: bool
    setpoint: BlockMember
    output: str
    word: str
    begins: list[str]
    manual: Callable[[Mapping[str, str]], list[str]]
    call: Callable[[Mapping[str, str]], list[str]]
    temporaries: tuple[str, ...] = ()
    ramp: Ramp | None
    switch: PwmSource
    input: str | None = None

    @property
    def blocks(self) -> list[str]:
        """The source of all blocks that stand before the organization blocks."""
        pulse_source = self.switch.by
        pwm = pwm_block(_PWM, PWM_DATA, self.switch, real=self.real) if pulse_source == OWN else []
        return [*pwm, *(self._pulsegen if pulse_source == PULSEGEN else []),
                *awl.block(DATA, "heater: what you set and watch", self._members), *self._anew]

    def restart(self, loads: list[str]) -> list[str]:
        """Return the source of OB100.

        Args:
            loads: statements that load the words.
        """
        return [
            "ORGANIZATION_BLOCK OB 100", "TITLE =restart: heater off, controller from cold, manual stays manual",
            "VERSION : 0.1", "VAR_TEMP", "  told : ARRAY  [1 .. 20 ] OF BYTE ;", "END_VAR", "BEGIN", "NETWORK",
            "TITLE =words", *loads, f"      CALL  FC {_ANEW};", "END_ORGANIZATION_BLOCK", "",
        ]

    @property
    def interrupt(self) -> list[str]:
        """The source of OB35."""
        at, low, broken = self.at, "-32768", ["      L     -32768;", "      ==I   ;"]
        if self.input == FOUR_TO_TWENTY:
            low, broken = f"below {LEAST}", [f"      L     {LEAST};  // 3.6 mA", "      <I    ;"]
        return [
            "ORGANIZATION_BLOCK OB 35", "TITLE =cyclic interrupt: one tick", "VERSION : 0.1", *_TOLD.splitlines(),
            *(f"  {each} ;" for each in self.temporaries),
            *([] if self.ramp is None else [f"  {each} ;" for each in _RAMP_TEMPORARIES]), "END_VAR", "BEGIN",
            "NETWORK", "TITLE =is this the interval of the proof?", "      L     #OB35_EXC_FREQ;",
            f"      L     {at['TICK_MS']};", "      <>I   ;", f"      =     {at['WRONG_CLOCK']};", "      JC    off;",
            "NETWORK", f"TITLE =a broken wire reads 32767 or {low}: heater off, begin anew when it is back",
            "      L     PIW 256;", "      T     #reading;", "      L     32767;", "      ==I   ;",
            f"      =     {at['FAULT']};", "      JC    off;", "      L     #reading;", *broken,
            f"      =     {at['FAULT']};", "      JCN   good;", f"off:  CALL  FC {_ANEW};", "      BEU   ;", "NETWORK",
            "TITLE =is the controller due?", f"good: L     {at['TICKS']};", "      L     L#0;", "      >D    ;",
            "      JC    wait;", f"      A     {at['AUTO']};", "      JC    auto;", "NETWORK", "TITLE =manual",
            *self.manual(at), *self._begins_again, "      JU    turn;", "NETWORK", "TITLE =automatic", "auto: NOP   0;",
            *self._led, "NETWORK", "TITLE =one call of the controller", "turn: NOP   0;", *self.call(at),
            f"      L     {self.output};", f"      T     {at['POWER']};", "NETWORK", "TITLE =ticks to the next call",
            f"wait: L     {at['TICKS']};", "      L     L#1;", "      +D    ;", f"      T     {at['TICKS']};",
            f"      L     {at['PER_CALL']};", "      <D    ;", "      JC    out;", "      L     L#0;",
            f"      T     {at['TICKS']};", "NETWORK", "TITLE =the heater's switch", "out:  NOP   0;", *self._switched,
            "END_ORGANIZATION_BLOCK",
        ]

    @property
    def at(self) -> Mapping[str, str]:
        """Name → operand of the program's data."""
        return awl.operands(DATA, self._members)

    @property
    def _members(self) -> list[BlockMember]:
        kind = "REAL" if self.real else "INT"
        bits = [
            BlockMember("AUTO", "BOOL", 0, "yours: 0 manual, 1 automatic"),
            BlockMember("FAULT", "BOOL", 0, "sensor broken: heater off"),
            BlockMember("WRONG_CLOCK", "BOOL", 0, "OB 35 has another interval than TICK_MS: heater off"),
            BlockMember("HEAT", "BOOL", 0, "heater on"),
        ]
        ramp = [] if self.ramp is None else [
            BlockMember("BEGUN", "BOOL", 0, "setpoint ramp under way"),
            BlockMember("LED", "INT", 0, "setpoint on its ramp"),
            BlockMember("COUNTDOWN", "INT", 0, "calls to its next step"),
        ]
        return [
            *bits, self.setpoint,
            BlockMember("POWER", kind, 0, f"yours in manual, {'%' if self.real else f'0..{FULL_SCALE}'}; follows else"),
            *ramp, BlockMember("TICK_MS", "INT", self.switch.tick_ms, "interval of OB 35"),
            BlockMember("TICKS", "DINT", 0, "since the last call of the controller"),
            BlockMember("PER_CALL", "DINT", self.switch.per_call, "ticks from one call of it to the next"),
        ]

    @property
    def _anew(self) -> list[str]:
        """Return the function that puts the heater off and lets all begin from cold."""
        at, pulse_source = self.at, self.switch.by
        zero = awl.real(0.0) if self.real else "0"
        own = awl.operands(PWM_DATA, pwm_members(self.switch, real=self.real))
        pwm = {
            OWN: ["      L     L#0;", f"      T     {own['TICK']};  // of the period",
                  f"      T     {own['COUNT']};  // of its ticks on"],
            PULSEGEN: [f"      CALL  FB {_PULSEGEN} , DB {_PULSEGEN} (", "           COM_RST := TRUE);"],
            ANALOG: ["      L     0;", "      T     PQW 256;"],
        }[pulse_source]
        return [
            f"FUNCTION FC {_ANEW} : VOID", "TITLE =heater off; all begins from cold",
            "VERSION : 0.1", "BEGIN", "NETWORK", "TITLE =controller", *self.begins,
            f"      L     {zero};", f"      T     {at['POWER']};", "      L     L#0;", f"      T     {at['TICKS']};",
            *self._begins_again, "NETWORK", "TITLE =heater", *pwm, "      CLR   ;", f"      =     {at['HEAT']};",
            *([] if pulse_source == ANALOG else _out("CLR   ")), "END_FUNCTION", "",
        ]

    @property
    def _begins_again(self) -> list[str]:
        """Return the statements after which the setpoint's ramp, if there is one, begins at the reading."""
        return [] if self.ramp is None else ["      CLR   ;", f"      =     {self.at['BEGUN']};"]

    @property
    def _led(self) -> list[str]:
        """Return the statements that lead the setpoint, if it is led."""
        if self.ramp is None:
            return []
        at, moves = self.at, renamed(setpoint_ramp(self.ramp), _RAMP)
        temporaries = {name: f"#{name.lower()}" for name in ("READING", "SIZE", "AHEAD", "BACK", "END")}
        printer = S7300Printer({**at, **temporaries}, words=("READING", *_RAMP.values()))
        return [f"      A     {at['BEGUN']};", "      JC    go;", "      L     #reading;",
                f"      T     {at['LED']};  // setpoint ramp begins at the reading", f"      L     {self.ramp.calls};",
                f"      T     {at['COUNTDOWN']};", "      SET   ;", f"      =     {at['BEGUN']};", "go:   NOP   0;",
                *printer.print_groups(moves), printer.next("NOP", "0")]

    @property
    def _switched(self) -> list[str]:
        at, by = self.at, self.switch.by
        if by == ANALOG:
            return [f"      L     {self.word};", "      T     PQW 256;"]
        if by == OWN:
            return [f"      CALL  FB {_PWM} , DB {PWM_DATA} (", f"           POWER := {self.output},",
                    f"           HEAT := {at['HEAT']});", *_out(f"A     {at['HEAT']}")]
        share = [] if self.real else [
            f"      L     {self.output};", "      ITD   ;", "      DTR   ;", f"      L     {awl.real(100.0)};",
            "      *R    ;", f"      L     {awl.real(FULL_SCALE)};", "      /R    ;", "      T     #share;"]
        return [
            *share, f"      CALL  FB {_PULSEGEN} , DB {_PULSEGEN} (",
            f"           INV := {self.output if self.real else '#share'},", "           STEP3_ON := FALSE,",
            "           ST2BI_ON := FALSE,", "           SYN_ON := FALSE,", "           COM_RST := FALSE,",
            f"           QPOS_P := {at['HEAT']});", *_out(f"A     {at['HEAT']}"),
        ]

    @property
    def _pulsegen(self) -> list[str]:
        """Return the instance of PULSEGEN: what is not said here has the block's own default."""
        tick = self.switch.tick_ms
        return [
            f"DATA_BLOCK DB {_PULSEGEN}", "TITLE =instance of the heater's PWM", "VERSION : 0.1", f"FB {_PULSEGEN}",
            "BEGIN", f"  PER_TM := T#{tick * self.switch.per_period}MS ;",
            f"  P_B_TM := T#{self.switch.shortest_ms}MS ;", "  STEP3_ON := FALSE ;", "  ST2BI_ON := FALSE ;",
            "  SYN_ON := FALSE ;", f"  CYCLE := T#{tick}MS ;", "END_DATA_BLOCK", "",
        ]


def counts_of(words: Words, temperature_degC: float) -> int:
    """Return the analog value of a temperature."""
    return count(module(words.scaling, FULL_SCALE, RANGES), temperature_degC)


def whole_number(words: Words) -> str:
    """Return how a setpoint becomes an analog value, as a reading does."""
    return "the nearest whole number" if has_ends(RANGES, words.scaling.input) else "cut to a whole number"


def by_hand(words: Words, certificate: Certificate, switch: PwmSource, *blocks: str) -> list[str]:
    """Return the facts about clock and switch, and what remains to be done by hand, numbered.

    Args:
        words: that are exported.
        certificate: of their proof.
        switch: as the program has it.
        blocks: of the Standard Library that have to be there, and what else is the controller's own, a step each.
    """
    analog, setpoint = switch.by == ANALOG, certificate.setpoint_degC
    addresses = (
        "PIW 256 in OB 35, PQW 256 in OB 35 and FC 101; the switch behind this analog output is yours, as proven"
        if analog else "PIW 256 in OB 35, Q 4.0, QB 4 and PQB 4 in OB 35 and FC 101; keep that byte for the heater: "
        "OB 35 writes all of it at once, not at the end of OB 1")
    steps = [
        *blocks,
        f"hardware configuration: OB 35 every {switch.tick_ms} ms; at another interval the heater stays off "
        f"(WRONG_CLOCK of DB {DATA}); without an OB 80 an OB 35 that takes longer stops the CPU",
        f"put your addresses: {addresses}",
        _range(words),
        f"begin in manual: AUTO of DB {DATA} is 0 after loading; a restart leaves it (0 where nothing is retained), "
        "clears the manual power and begins from cold",
        f"setpoint: SP of DB {DATA} is loaded {'as the lowest' if setpoint is None else 'as proven'}; another one is "
        "not proven",
    ]
    clock = "each tick" if switch.per_call == 1 else f"every {switch.per_call} ticks"
    missing = f"; the PWM is not in this program: {switch.reason}" if analog else ""
    return [
        f"TA: the controller is called every {1000 * words.sample_time_s:g} ms, {clock} of OB 35{missing}",
        "remains to be done by hand:", *(f"  {number}. {step}" for number, step in enumerate(steps, start=1)),
    ]


def _range(words: Words) -> str:
    """Return how the analog input is to be set up."""
    name, span = words.scaling.input, words.scaling.span_degC
    if name is None:
        return (f"analog input: a nominal range (mA, V), 0..{FULL_SCALE} = the sensor range, with wire-break check; "
                "thermocouple and RTD ranges give 0.1 degC per digit: design with --input thermocouple or rtd")
    if name == FOUR_TO_TWENTY:
        return (f"analog input: 4..20 mA = 0..{FULL_SCALE} = the sensor range, with wire-break check; below 3.6 mA "
                f"({LEAST}) the heater is off all the same")
    return (f"analog input: the range of {INPUTS[name]} in degC, {span / FULL_SCALE:g} degC per digit, with wire-break "
            "check; the setpoint must lie within the range of its type")


def _out(state: str) -> list[str]:
    """Return the statements that write the heater's output at once: OB1 would write it at its end."""
    return [f"      {state};", "      =     Q 4.0;", "      L     QB 4;", "      T     PQB 4;"]
