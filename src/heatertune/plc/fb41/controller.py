"""The room of CONT_C: its four doors under one name."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Final

from heatertune.plc.controller import Core, Number, Room, Running, Scan, Timing, Words, count
from heatertune.plc.cpu.s7_300.module import FULL_SCALE
from heatertune.plc.cpu.s7_300.real import clamp, quotient, real
from heatertune.plc.cpu.s7_300.timer import TIMER
from heatertune.plc.fb41.export import export_words
from heatertune.plc.fb41.image import from_image, oddities
from heatertune.plc.fb41.step import Assumptions, Parameters, State, call, restart, scaled
from heatertune.plc.fb41.words import FIELDS, check_words, decode, encode

__all__ = ["ROOM", "ContC"]

#: SP_PER is a setpoint as an analog value; SP_INT, where given, is the block's own input
_INPUTS: Final = {
    "SP_PER": "INT", "PV_PER": "INT", "SP_INT": "REAL", "MAN_ON": "BOOL", "MAN": "REAL", "DISV": "REAL",
    "INT_HOLD": "BOOL", "COM_RST": "BOOL",
}


def _step(
    parameters: tuple[Parameters, Assumptions], state: State, setpoint: int, reading: int, _begins: bool
) -> tuple[State, float, float, int]:
    asked, _ = scaled(parameters[0], setpoint)
    return _called(parameters[0], parameters[1], state, asked, reading)


def _called(
    p: Parameters, assume: Assumptions, state: State, setpoint: float, reading: int
) -> tuple[State, float, float, int]:
    pv, os = scaled(p, reading)
    return _told(call(p, assume, state, setpoint, pv, os))


def _told(after: State) -> tuple[State, float, float, int]:
    """Return the state, LMN as power, LMN, and the flags as bits."""
    bits = int(after.at_upper) + 2 * int(after.at_lower) + 4 * int(after.overflow)
    return after, clamp(after.output, 0.0, 100.0), after.output, bits


_CORE: Final = Core(step=_step, measure=count, flags=("QLMN_HLM", "QLMN_LLM", "overflow"))


@dataclass(frozen=True, slots=True, kw_only=True, eq=False)
class ContC(Room):
    """See `heatertune.plc.controller.Room`."""

    def timing(self, words: Words) -> Timing:
        """Return OB35's interval; the PWM is an actuator behind LMN."""
        return Timing(scan_s=words.sample_time_s)

    def begin(self, words: Words, assume: Assumptions) -> Running:
        """Return the state after OB100's call with COM_RST."""
        parameters = _parameters(words.values)
        return Running((parameters, assume), restart(parameters))

    def scan(self, state: Running, inputs: Mapping[str, Number]) -> tuple[Running, Scan]:
        """Call the block once with PV_PER and SP_PER or SP_INT; what is not named stays as the words have it."""
        p, assume = state.parameters
        p = p._replace(
            man_on=bool(inputs.get("MAN_ON", p.man_on)), manual=inputs.get("MAN", p.manual),
            disturbance=inputs.get("DISV", p.disturbance), int_hold=bool(inputs.get("INT_HOLD", p.int_hold)),
        )
        if inputs.get("COM_RST", 0):
            after, *told = _told(restart(p))
        else:
            setpoint = inputs["SP_INT"] if "SP_INT" in inputs else scaled(p, int(inputs["SP_PER"]))[0]
            after, *told = _called(p, assume, state.state, setpoint, int(inputs["PV_PER"]))
        return Running(state.parameters, after), _CORE.told(told)


def _parameters(v: Mapping[str, Number]) -> Parameters:
    """Return the words as the block computes with them: TIME in ms becomes REAL in s."""
    seconds = {name: quotient(real(v[name])[0], 1000.0)[0] for name in ("CYCLE", "TI", "TD", "TM_LAG")}
    return Parameters(
        cycle=seconds["CYCLE"], gain=v["GAIN"], ti=seconds["TI"], td=seconds["TD"], tm_lag=seconds["TM_LAG"],
        dead_band=v["DEADB_W"], upper=v["LMN_HLM"], lower=v["LMN_LLM"], pv_factor=v["PV_FAC"], pv_offset=v["PV_OFF"],
        lmn_factor=v["LMN_FAC"], lmn_offset=v["LMN_OFF"], initial=v["I_ITLVAL"], disturbance=v["DISV"],
        manual=v["MAN"], man_on=bool(v["MAN_ON"]), p_sel=bool(v["P_SEL"]), i_sel=bool(v["I_SEL"]),
        int_hold=bool(v["INT_HOLD"]), i_itl_on=bool(v["I_ITL_ON"]), d_sel=bool(v["D_SEL"]),
    )


ROOM: Final = ContC(
    name="fb41",
    title="SIMATIC S7-300/400, FB41 CONT_C (Standard Library; SFB41 of the CPU 31xC)",
    fields=FIELDS,
    assumptions=Assumptions,
    inputs=_INPUTS,
    can=(
        "P, PI, PD and PID in single precision with a filtered derivative of the error; PV and setpoint in °C",
        "dead band, limits, feed-forward DISV, manual with a smooth return",
        "setpoint ramp in whole analog values: OB35 of the export leads SP_INT",
    ),
    cannot=(
        "no PWM of its own: FB43 PULSEGEN or a switch behind LMN is proven with it (--pwm-rule pulsegen)",
        "no setpoint weights: the block has none", "PV_IN is left out: the reading comes from PV_PER",
    ),
    counts=FULL_SCALE,
    sample_times_s=TIMER,
    derivative_filter=0.5,
    encode=encode,
    decode=decode,
    check=check_words,
    export=export_words,
    core=_CORE,
    read_image=from_image,
    oddities=oddities,
    ramped=True,
)
