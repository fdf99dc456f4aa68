"""The whole program as one listing: OB251's data block, the blocks around it, and what is left to do by hand."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from typing import Final

from heatertune.plc.inputs import FOUR_TO_TWENTY
from heatertune.plc.s5_ob251.blocks import (
    ANALOG,
    DB,
    FOUR_MA,
    HEAT,
    INPUT,
    MODE,
    OUTPUT,
    START,
    WORK,
    heat,
    organisation_blocks,
    ramp_block,
    start_up,
    work,
)
from heatertune.plc.s5_ob251.staircase import Staircase, staircase
from heatertune.plc.s5_ob251.step import FULL_SCALE
from heatertune.plc.words import Certificate, Words

__all__ = ["program_listing", "retains"]

#: of OB13 where nobody writes SD97 [s]
_USUAL_S: Final = 0.1
#: that a call of FB30 takes, OB251 aside: some forty statements on a CPU 941 [ms]
_CALL_MS: Final = 2.0


def program_listing(words: Words, certificate: Certificate, asked: int, typed: Sequence[str]) -> str:
    """Return the listing.

    Args:
        words: that were proven.
        certificate: of the proof.
        asked: setpoint [units].
        typed: lines of DB30.
    """
    stairs = staircase(certificate.actuator, words.sample_time_s)
    interval = words.sample_time_s if stairs is None else words.sample_time_s / stairs.ticks.per_call
    by_hand = _by_hand(words, certificate, stairs, interval)
    head = [
        "Whole program around OB251 for SIMATIC S5-115U: a listing to key in, remarks behind ;",
        *_conditions(words, stairs, interval), _start_up(certificate), *certificate.head,
        "to do by hand:", *(f"{number}. {what}" for number, what in enumerate(by_hand, 1)),
    ]
    ramp = words.ramp
    scale = words.scaling
    started = start_up(interval, pwm=stairs is not None, ramp=ramp, retained=retains(certificate))
    blocks = [
        [f"DB{DB}", *typed], [f"DB{WORK}", *_work(asked, words)], heat(stairs, ramp, scale.input), started,
        *([] if ramp is None else [ramp_block(ramp)]), *organisation_blocks()]
    return "\n".join([*(f"// {line}" for line in head), *(line for block in blocks for line in ("", *block))]) + "\n"


def _conditions(words: Words, stairs: Staircase | None, interval_s: float) -> Iterator[str]:
    scale = words.scaling
    yield (f"sensor {scale.low_degC:g}...{scale.high_degC:g} °C = 0...{FULL_SCALE} units; "
           f"output 0...{FULL_SCALE} units = 0...100 % power")
    called = "" if stairs is None or stairs.ticks.per_call == 1 else f" in every {stairs.ticks.per_call}th call"
    yield f"OB13 every {interval_s:g} s calls FB{HEAT}, which calls OB251{called}: TA = {words.sample_time_s:g} s"
    if stairs is not None:
        yield f"PWM: {stairs.ticks.per_period} calls of OB13 a period, the nearest whole number of them on"
    if words.ramp is not None:
        yield f"W follows the setpoint asked for: {words.ramp}"


def retains(certificate: Certificate) -> bool:
    """Return whether OB251 goes on after a start-up with what it kept."""
    return certificate.switches.get("start_up") == "retained"


def _start_up(certificate: Certificate) -> str:
    if retains(certificate):
        return ("start-up: OB251 goes on with what DW18 to DW48 have kept, or from cold where they have kept nothing; "
                "the rest begins anew")
    return "start-up: OB21 and OB22 clear DW18 to DW48, whatever they have kept; the rest begins anew"


def _by_hand(
    words: Words, certificate: Certificate, stairs: Staircase | None, interval_s: float
) -> Iterator[str]:
    """Return what no listing does."""
    scale, count = words.scaling, words.scaling.span_degC / FULL_SCALE
    module = (f"range card for 4 to 20 mA, {FOUR_MA} to 2560 units; below 3.6 mA the heater is off"
              if scale.input == FOUR_TO_TWENTY else
              "two's complement, 2048 units at the end of its range, wire-break detection on")
    yield (f"Wire or change: analog input {INPUT} ({module}), automatic {MODE}, "
           + (f"analog output {ANALOG}." if stairs is None else f"heater {OUTPUT.replace('PY', 'Q')}.0; {OUTPUT} is "
              "written as a whole: no other output in that byte."))
    yield (f"Range the sensor: {scale.low_degC:g} °C = 0 units, {scale.high_degC:g} °C = {FULL_SCALE} units, "
           f"{count:.3g} °C a unit.")
    yield (f"Setpoint: DW 0 of DB{WORK}, whole part of ({FULL_SCALE}/{scale.span_degC:g})*({scale.formula})"
           + (" - enter yours." if certificate.setpoint_degC is None else "; the proven one is in it."))
    yield (f"Your own OB1, OB13, OB21, OB22: add these statements to them. DB{DB}, DB{WORK}, FB{HEAT}, FB{START} and "
           "FB33 must be free.")
    if stairs is None:
        yield f"Power controller behind {ANALOG}; nothing here makes pulses. {_unmade(certificate)}"
    if interval_s < _USUAL_S:
        share = 0.1 * _CALL_MS / interval_s
        yield (f"OB13 every {1000.0 * interval_s:g} ms takes up to {share:.2g} % of a CPU 941's time, whose OB13 was "
               "made for 100 ms: see that the cycle of OB1 stays short.")
    yield (f"Try out with the heater disconnected: manual ({MODE} = 0) holds YH = DW 12 of DB{DB}; a broken sensor "
           f"switches off until {MODE} was 0.")
    if retains(certificate):
        yield (f"Backup battery: without one DB{DB} and DB{WORK} begin as they stand here, from cold and with this "
               "setpoint; start-up as chosen needs it.")
    yield "A limiter of its own that switches the heater off: no program stands for it."


def _unmade(certificate: Certificate) -> str:
    if certificate.actuator is None:
        return "Which switch was proven is not told."
    return f"It was proven as a switch: {certificate.actuator.summary}, which calls of OB13 do not make."


def _work(asked: int, words: Words) -> Iterator[str]:
    for dw, (value, comment) in enumerate(work(asked, words.ramp)):
        yield f"{f'{dw:4d}:  KF = {value:+06d};'.ljust(33)}{comment}"
