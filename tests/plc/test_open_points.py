"""Every setting of every open point against outputs worked out by hand from what its controller's source says.

The numbers are such that nothing rounds but where rounding is the point; the sums stand beside them.
"""

from dataclasses import dataclass, replace
from itertools import combinations
from typing import Annotated, NamedTuple

import pytest

from heatertune.errors import UnknownName
from heatertune.pid.design_values import PidDesign
from heatertune.plc import TARGETS, Controller, OpenPoint, Scaling, Words, controller_for
from heatertune.plc.open_points import NothingOpen, assumptions_from, open_points_of
from heatertune.plc.replay import replay

DESIGN = PidDesign(gain_pct_per_degC=1.0, integral_time_s=100.0, derivative_time_s=0.0, sample_time_s=1.0, structure="pi",
                   method="")


@dataclass(frozen=True, kw_only=True)
class Case:
    """One open point: words, inputs scan by scan, and for each setting the outputs that the source asks for."""

    target: str
    switch: str
    words: dict
    rows: list
    outputs: dict

    def __str__(self):
        return f"{self.target} {self.switch}"

    def of(self, settings):
        return [scan.output for scan in replay(controller_for(self.target), _words(self), self.rows, settings)]


def _words(case):
    its = controller_for(case.target)  # a printer's is 0.3 s
    ta = its.timer.round(1.0) if its.interval_s is None else its.interval_s(case.words)
    return Words(target=case.target, values=case.words, scaling=Scaling(), sample_time_s=ta)


def _columns(**inputs):
    return [dict(zip(inputs, row, strict=True)) for row in zip(*inputs.values(), strict=True)]


# OB251, in units: dY = K·[(XW − XW before) + TI·XW] with K = R = 1024/1024, X = 0, so XW = W
OB251 = {"K": 1024, "R": 1024, "TI": 0, "TD": 0, "W": 0, "STEU": 1 + 32, "YH": 0, "BGOG": 100, "BGUG": 0}


def _ob251(switch, words, w, outputs, **inputs):
    rows = _columns(W=w, X=[0] * len(w), **inputs)
    return Case(target="s5-ob251", switch=switch, words=OB251 | words, rows=rows, outputs=outputs)


# the repaired program: width in ms grows by KP/2^SCALE per count of the error's change, the first error counting as a change
S7_200 = {"KP": 2, "KI": 0, "KD": 0, "SCALE": 1, "TICK": 100, "TICKS": 10}

# the printed program: at an edge the width grows by the high word of KP·256·(SP − PV): with KP = 256 by SP − PV, in ms;
# the error of scan 1 is in that sum after scan 2, and the edge of the first scan's S Q0.0 is served before scan 3
PAPER = {"KP": 256, "KI": 0, "KD": 0, "T": 1, "CYCLE": 1000, "POT1": 0}


def _paper(switch, sp, pv, begins, outputs):
    return Case(target="s7-200-paper", switch=switch, words=PAPER, rows=_columns(SP=sp, PV=pv, CYCLE_START=begins),
                outputs=outputs)


# the PID instruction as P: M = (SP − PV)/32000, and a width of M·1000 ms; 60·Ti is beyond single precision, so Ts/Ti = 0
PID = {"KC": 1.0, "TS": 1.0, "TI": 3.4028234663852886e38, "TD": 0.0, "TICK": 100, "TICKS": 10}


def _pid(switch, pv, outputs):
    return Case(target="s7-200-pid", switch=switch, words=PID, rows=_columns(SP=[16000] * len(pv), PV=pv), outputs=outputs)


def _tip(switch, gain, rate, reset, sample, sp, pv, outputs):
    words = {"GAIN": gain, "RATE": rate, "RESET": reset, "SAMPLE": sample}
    return Case(target="s7-300", switch=switch, words=words, rows=_columns(SP=sp, PV=pv), outputs=outputs)


def _fb41(switch, changed, errors, outputs):
    """GAIN = 1, limits 0…100; SP_INT − PV is the error, as PV_PER = 0 is 0 °C."""
    words = dict(controller_for("fb41").encode(DESIGN, Scaling()).values)
    words |= {"CYCLE": 1000, "GAIN": 1.0, "P_SEL": 1, "I_SEL": 1, "D_SEL": 0} | changed
    return Case(target="fb41", switch=switch, words=words, rows=_columns(SP_INT=errors, PV_PER=[0] * len(errors)),
                outputs=outputs)


# WEG: academic form, Kp = 1, Ts = 1 s: u = i + (1 + Ki + Kd)·e − Kd·e before, i grows by Ki·e; the first scan is EN's edge
WEG = {"Kp": 1.0, "Ki": 0.0, "Kd": 0.0, "TauSetPoint": 0.0, "MinimumOutput": 0.0, "MaximumOutput": 100.0, "Type": 0,
       "Action": 0, "Ts": 1000}


def _iec(words, rows, outputs, target="iec-pid"):
    own = {"XMIN": 0.0, "XMAX": 100.0} if target == "iec-pid" else {}
    return Case(target=target, switch="time_unit", words={"KP": 1.0, "TR": 1.0, "TD": 0.0, "CYCLE": 1000} | own | words, rows=rows, outputs=outputs)


def _weg(switch, words, rows, outputs):
    return Case(target="weg", switch=switch, words=WEG | words, rows=rows, outputs=outputs)


# Marlin as I, the window of 10 °C not left; PID_v1, ESPHome and simple-pid as I each second
MARLIN = {"Kp": 0.0, "Ki": 31.25, "Kd": 0.0, "PID_MAX": 255, "PID_FUNCTIONAL_RANGE": 10, "PID_K1": 0.5, "ADC_LOOPS": 10}
ARDUINO = {"Kp": 0.0, "Ki": 0.0, "Kd": 0.0, "POn": 1, "OutMax": 255.0, "Full": 255.0, "SampleTime": 1000}
ESPHOME = {"kp": 0.0, "ki": 1 / 64, "kd": 0.0, "min_integral": 0.0, "max_integral": 1.0, "derivative_averaging_samples": 1,
           "update_interval": 1000}
SIMPLE = {"Kp": 0.0, "Ki": 0.5, "Kd": 0.0, "output_max": 100.0, "proportional_on_measurement": 0, "differential_on_measurement": 1,
          "PERIOD_MS": 1000}


def _arduino(switch, words, errors, outputs):
    rows = _columns(Setpoint=[50.0] * len(errors), Input=[50.0 - error for error in errors])
    return Case(target="arduino-pid", switch=switch, words=ARDUINO | words, rows=rows, outputs=outputs)
# panel instruments: 0.01 °C a count, PB 100.0 °C: K = 1 %/°C; one sample a second
PBAND = {"Pb": 1000, "ti": 0, "td": 0, "CYC": 20, "OPH": 1000}


def _pband(switch, words, setpoint, reading, outputs):
    return Case(target="pband", switch=switch, words=PBAND | words, rows=_columns(SP=setpoint, PV=reading), outputs=outputs)
# both blocks: y = P + I + D with Gain = 1, T = 1 s, b = 1, c = 0 and I empty at first
COMPACT = {"Gain": 1.0, "Ti": 0.0, "Td": 0.0, "TdFiltRatio": 1.0, "PWeighting": 1.0, "DWeighting": 0.0, "Cycle": 1.0,
           "OutputUpperLimit": 100.0, "OutputLowerLimit": 0.0, "InvertControl": 0, "IntegralResetMode": 1}


def _compact(switch, words, setpoints, readings, outputs):
    rows = _columns(Setpoint=setpoints, Input=readings)
    heating = {name: value for name, value in (COMPACT | words).items() if name != "InvertControl"}
    return [Case(target="pid-compact", switch=switch, words=COMPACT | words, rows=rows, outputs=outputs),
            Case(target="pid-temp", switch=switch, words=heating, rows=rows, outputs=outputs)]


CASES = [
    # b = 0: P = −60 all the time; T/TI = 1. e = 80: I = 80. e = 100: the sum would be 120, so I stays 80; or it grows
    # to 180, as nothing was beyond before; or to 100 + 60. e = 20 twice: I = 120 with sums of 40 and 60, or it is held at 100; the
    # others stay beyond. e = 0: −60 + I. e = −50: −60 + I − 50, or with 100 that would be −10, so I stays
    *_compact("anti_windup", {"Ti": 1.0, "PWeighting": 0.0}, [140.0, 160.0, 80.0, 80.0, 60.0, 10.0], [60.0] * 6,
              {"stopped": [20.0, 20.0, 40.0, 60.0, 60.0, 10.0], "late": [20.0, 100.0, 100.0, 100.0, 100.0, 70.0],
               "limited": [20.0, 20.0, 40.0, 40.0, 40.0, 40.0], "clamped": [20.0, 100.0, 100.0, 100.0, 100.0, 50.0]}),
    # T/TI = 1/4, e = 8 from the first cycle on: I = 2; then e = 16: I = 2 + 4, 2 + 2 or 2 + 3
    *_compact("integral", {"Ti": 4.0}, [8.0, 16.0], [0.0, 0.0],
              {"backward": [10.0, 22.0], "forward": [10.0, 20.0], "trapezoid": [10.0, 21.0]}),
    # P = 40 and v falls from −10 to −20 (c = 0) against the reading's step: TD = 2, a·TD = 2 s. Shares of the past 2/3, 3/5 and
    # exp(−1/2), the rest of TD/T·10: D = −20/3, −8, −7.869; or TD/(a·TD)·10
    *_compact("derivative_lag", {"Td": 2.0}, [50.0, 60.0], [10.0, 20.0],
              {"backward": [40.0, 33.3333321], "tustin": [40.0, 32.0], "ramp": [40.0, 32.1306152], "step": [40.0, 30.0]}),
    # Td = 2, no lag: v = −10 from 0: D = −20; then it stays
    *_compact("history", {"Td": 2.0, "TdFiltRatio": 0.0}, [50.0, 50.0], [10.0, 10.0],
              {"present": [40.0, 40.0], "zero": [20.0, 40.0]}),

    # Y = 150, limited: YA = 100. Then dY = 50 − 150 = −100, from 150 or from 100
    _ob251("sum", {}, [150, 50], {"unlimited": [100, 50], "limited": [100, 0]}),
    # TI = 1/2: Y = 80 + 40 = 120 beyond 100. Before this call no limit was reached; at this one it is, so only the 80 count
    _ob251("integral_off", {"TI": 512}, [80], {"previous_call": [100], "same_call": [80]}),
    # again Y = 120, at the limit; then dP = −10 − 80 = −90 and dI = −5, which leads back: 120 − 90, or 120 − 95
    _ob251("integral_inward", {"TI": 512}, [80, -10], {"off": [100, 30], "on": [100, 25]}),
    # TI = 1/4: dY = 2 + 1/2, then 1/2: Y = 5/2, 3; or of whole increments 2 + 0. YA is cut
    _ob251("rounding", {"TI": 256}, [2, 2], {"fraction_kept": [2, 3], "whole_increments": [2, 2]}),
    # TI = 1/2, BGOG 120: Y = 80 + 40 is the limit. I rests then, and Y = 120 − 20; or it adds 40 first, and rests: 160 − 20
    _ob251("limit", {"TI": 512, "BGOG": 120}, [80, 80, 60], {"reached": [120, 120, 100], "exceeded": [120, 120, 120]}),
    # by hand at BGOG, YH = 200 halved. TI = 1/2, XW = 10: I acts, Y = 105, and rests beyond: 105 − 10; or it rests at once:
    # 100, then at the limit 100 − 10
    _ob251("manual_flag", {"TI": 512, "YH": 200}, [10, 10, 0], {"clear": [100, 100, 95], "by_output": [100, 100, 90]},
           STEU=[32, 33, 33]),
    # bit 3: Y = 40, dY = 10, then position again with dY = 0: from the 10 or from the 40
    _ob251("velocity_return", {}, [40, 50, 50], {"last_increment": [40, 10, 10], "sum_kept": [40, 10, 40]}, STEU=[33, 41, 33]),
    # half the way to 5 is 5/2. TI = 1/2, XW = 1: 2 + 1/2, or 5/2 + 1/2
    _ob251("manual_way", {"TI": 512, "YH": 5}, [1, 1], {"whole": [2, 2], "fraction_kept": [2, 3]}, STEU=[32, 33]),
    # four calls to 80, one held (bit 4), then to 0: at once, or by half of the way
    _ob251("manual_count", {}, [0] * 6, {"outlives": [40, 60, 70, 80, 80, 0], "begins_anew": [40, 60, 70, 80, 80, 40]},
           STEU=[32] * 4 + [48, 32], YH=[80] * 5 + [0]),

    # errors 10 and 15: widths 2·10/2 and 10 + 2·5/2 ms; or each one PWM cycle later, after none
    Case(target="s7-200", switch="width_applies", words=S7_200, rows=_columns(SP=[100, 100], PV=[90, 85]),
         outputs={"this_cycle": [10, 15], "next_cycle": [0, 10]}),

    # error 10: 10 ms at the first edge, 20 ms at the next. One cycle later: still 0 ms after the first edge, so no other comes
    _paper("width_applies", [60] * 4, [50] * 4, [0, 0, 0, 1],
           {"this_cycle": [0, 0, 10, 20], "next_cycle": [0, 0, 0, 0]}),
    # 130 and 120 in high bytes: −32256 − 30720 = −62976, and + 65536 = 2560 = 256·10 where it wraps: 10 ms. Else −32256 stays:
    # −126 ms, limited to 0
    _paper("overflow", [130] * 3, [120] * 3, [0, 0, 0], {"keep": [0, 0, 0], "wrap": [0, 0, 10]}),
    # error −10 in the first scan: 0 ms at the first edge. Then error 10: 10 ms at the next one, if it comes
    _paper("rails", [60] * 4, [70, 50, 50, 50], [0, 0, 0, 1],
           {"edges_stop": [0, 0, 0, 0], "edges_go_on": [0, 0, 0, 10]}),
    # error 1: 1 ms at the first edge. No PWM cycle of 1000 ms begins in the fourth scan, but one of 2 ms does: 2 ms
    _paper("cycle_time", [51] * 4, [50] * 4, [0, 0, 0, 0], {"loaded": [0, 0, 1, 1], "never_loaded": [0, 0, 1, 2]}),

    # M = 1/2 − 1/4 and 1/2 − 1/8; or each width one PWM cycle later
    _pid("width_applies", [8000, 8000, 4000], {"this_cycle": [250, 250, 375], "next_cycle": [0, 250, 250]}),

    # Output = 1/2048·1/2; 27648/4096 = 6.75
    _tip("conversion", 2.0**-11, 0.0, 0.0, 1000.0, [13824], [0], {"rnd": [7], "trunc": [6]}),
    # Gain 1, CI = 4000/1000, CD = 16000/4000. First SP − PV = 1/2: MP = 1/2, MI = 2, Output > 1, Bias = 1 − 1/2.
    # Then 1/2 − 1/4: MP = 1/4, MI = 1/2 + 1, MD = −1: Output = 3/4 of 27648; MI = 3/2 is not adjusted: Bias = 3/2, or 1.
    # Then 0 − 1/4: MP = −1/4, MI = Bias − 1, MD = 0: Output = 1/4, or −1/4
    _tip("bias_clamp", 1.0, 16000.0, 1000.0, 4000.0, [13824, 13824, 0], [0, 6912, 6912],
         {"adjusted": [27648, 20736, 6912], "always": [27648, 20736, 0]}),
    # MP = 3/4 − 1/4 and MD = PV before − PV, with Rate = Sample: 0, or −1/4
    _tip("first_reading", 1.0, 1000.0, 0.0, 1000.0, [20736], [6912], {"taken": [13824], "zero": [6912]}),

    # CYCLE/TI = 1/4, error 8, before it 0: I = 1/4·4, then 1/4·8 more; or 1/4·8 both times. P = 8
    _fb41("integral", {"TI": 4000}, [8.0, 8.0], {"trapezoid": [9.0, 11.0], "rectangle": [10.0, 12.0]}),
    # D = TD/(1/2 s + TM_LAG)·8 = 5/2·8, or 5/(1 s + 3/2 s)·8
    _fb41("derivative_lag", {"P_SEL": 0, "I_SEL": 0, "D_SEL": 1, "TD": 5000, "TM_LAG": 1500}, [8.0],
          {"half_cycle": [20.0], "whole_cycle": [16.0]}),
    # CYCLE/TI = 2: I = 2·(120 + 0)/2 = 120 is alone beyond 100, and P + I = 240. Taken back to 100, or held at 120; then
    # 2·(−40 + 120)/2 would leave further, so I stays: I − 40
    _fb41("anti_windup", {"TI": 500}, [120.0, -40.0], {"taken_back": [100.0, 60.0], "held": [100.0, 80.0]}),

    # Ki = 1/2, e = 80: u = 3/2·80 = 120, limited; i = 40, or 100 − 80 so that Kp·e + i is within, or 0 as before.
    # Then e = 10: u = i + 15
    _weg("anti_windup", {"Ki": 0.5}, _columns(SetPoint=[80.0] * 3, Feedback=[0.0, 0.0, 70.0]),
         {"clamp": [0, 100, 35], "freeze": [0, 100, 15], "none": [0, 100, 55]}),
    _weg("manual", {}, _columns(SetPoint=[10.0] * 2, Feedback=[0.0] * 2, ManualSetPoint=[150.0] * 2, SelectSetPoint=[0, 1]),
         {"limited": [0, 100], "unlimited": [0, 150]}),
    # Ki = 1/2, e = 10, by hand 50: i stays 0, or becomes 50 − 10; then u = i + 15
    _weg("manual_return", {"Ki": 0.5},
         _columns(SetPoint=[10.0] * 3, Feedback=[0.0] * 3, ManualSetPoint=[50.0] * 3, SelectSetPoint=[0, 1, 0]),
         {"held": [0, 50, 15], "bumpless": [0, 50, 55]}),
    # Tau = Ts, the filter at 0: it goes half of the way to 100, or 1 − 1/e of it
    _weg("filter", {"TauSetPoint": 1.0}, _columns(SetPoint=[0.0, 100.0], Feedback=[0.0] * 2),
         {"implicit": [0, 50], "exact": [0, 63.2120559]}),
    # 1 + 2^24 is 2^24 in single precision: as printed, 2^24·3 − 2^24·3 leaves nothing of P; by parts it is 3, and D is 0
    _weg("order", {"Kd": 2.0**24}, _columns(SetPoint=[3.0] * 2, Feedback=[0.0] * 2),
         {"as_printed": [0, 0], "by_parts": [0, 3]}),
    _weg("edge", {}, _columns(SetPoint=[10.0] * 2, Feedback=[0.0] * 2),
         {"output_zero": [0, 10], "runs_at_once": [10, 10]}),
    # Kd = 2, Tau = Ts: the filter is at 10 from the edge on, and u = 3·10 − 2·10; or it goes from 0 to 5, and u = 3·5 − 2·0
    _weg("history", {"Kd": 2.0, "TauSetPoint": 1.0}, _columns(SetPoint=[10.0] * 2, Feedback=[0.0] * 2),
         {"present": [0, 10], "zero": [0, 15]}),
    # u = 10 + the sum of 10·Ts/TN: at each call, or at every second one; a program that is told calls a block that keeps Ts rightly
    _weg("sampling", {"Ki": 0.125}, _columns(SetPoint=[10.0] * 5, Feedback=[0.0] * 5),
         {"caller": [0, 11.25, 12.5, 13.75, 15], "skipped": [0, 0, 11.25, 11.25, 12.5], "block": [0, 11.25, 12.5, 13.75, 15]}),

    # Kp/255 = 1/10: 3 °C ask for 0.3, then 3.3 °C for 0.33. With max_power 0.5 that is more than 5 % of it, not of full power, and
    # is sent at once; or with the ninth report, 2.4 s after the first; or with the fifteenth
    Case(target="klipper", switch="firmware",
         words={"pid_Kp": 25.5, "pid_Ki": 0.0, "pid_Kd": 0.0, "max_power": 0.5, "smooth_time": 1.0},
         rows=_columns(target=[200.0] * 10, temperature=[197.0] + [196.7] * 9),
         outputs={"klipper": [0.3] + [0.33] * 9, "kalico": [0.3] * 8 + [0.33] * 2, "older": [0.3] * 10}),

    # e = 1 °C, I = 31.25 per s: each update adds 31.25·0.16 = 5 of 255, or 31.25·0.16384 = 5.12; the whole number is halved
    Case(target="marlin", switch="timer", words=MARLIN, rows=_columns(target=[200.0] * 20, celsius=[199.0] * 20),
         outputs={"1000hz": [5 * k // 2 for k in range(1, 21)], "977hz": [int(5.12 * k) // 2 for k in range(1, 21)]}),
    # Kd/0.16 = 100 per °C, half of it new: at 195 °C after 180 °C outside the window, D = -1500/2, or -19500/2 from the 0 of power-on;
    # P = 160·5 and no I: 50, or off. Then the change is 0, and half of D is left: 800 - 375, or 800 - 4875
    Case(target="marlin", switch="history", words=MARLIN | {"Kp": 160.0, "Ki": 0.0, "Kd": 16.0},
         rows=_columns(target=[200.0] * 3, celsius=[180.0, 195.0, 195.0]), outputs={"all": [127, 25, 127], "inside": [127, 0, 0]}),
    # 2^24 + 1 is 2^24 in single precision. Errors 2 and 1, so D = -2^24: P + D = 1, or 0
    _arduino("double", {"Kp": 2.0**24 + 1.0, "Kd": 2.0**24}, [2.0, 1.0], {"64bit": [255, 1], "32bit": [255, 0]}),
    # each of ten calls adds 1/2·e = 1, or the tenth is missed
    _arduino("calls", {"Ki": 0.5}, [2.0] * 11, {"on_time": [*range(1, 12)], "late": [*range(1, 10), 9, 10]}),
    # dt is measured: the first is 0, then each adds 1/64·1·1 s; the tenth reading is lost, and the eleventh adds 2 s
    Case(target="esphome", switch="calls", words=ESPHOME, rows=_columns(target_temperature=[51.0] * 11, current_temperature=[50.0] * 11),
         outputs={"on_time": [k / 64 for k in range(11)], "late": [*(k / 64 for k in range(9)), 8 / 64, 10 / 64]}),
    # likewise, but the first call counts as a whole interval: 1 % each second
    Case(target="simple-pid", switch="calls", words=SIMPLE, rows=_columns(setpoint=[52.0] * 11, input_=[50.0] * 11),
         outputs={"on_time": [*range(1, 12)], "late": [*range(1, 10), 9, 11]}),
    # K·e = 80, and half of it would be 120: I stays 0; or is 100 − 80; or 40, which is within the limits by itself. Then 10 + 5 + I
    _pband("anti_windup", {"ti": 2}, [8000, 1000], [0, 0], {"held": [80, 15], "tracking": [100, 35], "outside_band": [100, 55]}),
    # TV/8 = TA, so half of TV/TA·10 °C = 80; of the error alone, as the reading stays
    _pband("derivative", {"td": 8}, [1000, 2000], [0, 0], {"reading": [10, 20], "error": [10, 60]}),
    # half of 80, or with a lag of 2 s a third
    _pband("derivative_lag", {"td": 8}, [5000, 5000], [4000, 3000], {"eighth": [10, 60], "quarter": [10, 20 + 80 / 3]}),
    # TN = TA: K·e + I = 2·10; or of 0.65·10, the filter being at the reading
    _pband("setpoint", {"ti": 1}, [1000], [0], {"as_it_is": [20], "filtered": [13]}),
    _pband("arithmetic", {}, [1006], [1000], {"float": [0.06], "integer": [0.1]}),
    # 10.06 less 10.03, or 10.1 less 10.0
    _pband("reading", {}, [1006], [1003], {"fine": [0.03], "display": [0.1]}),
    # e = 32, then −17.25: 32·(1 + T), then 14.75·T − 17.25 = 0.02225 with T = 1.171, 0.0075 with 1.17, in singles (NumPy's); ns has the
    # single of 1171000000 over that of 10⁹, one digit more
    _iec({"CYCLE": 1171}, _columns(SP=[32.0] * 2, PV=[0.0, 49.25]),
         {"s": [69.472, 0.022249221801757812], "ten_ms": [69.44, 0.00749969482421875], "ns": [69.472, 0.022251129150390625]}),
    # ERROR = 2: −(2 + 2·T/8), T being 1.5 s, or 1500, 150, 1.5e9 units
    _iec({"KP": -1.0, "TR": 8.0, "CYCLE": 1500}, _columns(SP=[50.0], PV=[52.0]),
         {"s": [-2.375], "ms": [-377.0], "ten_ms": [-39.5], "ns": [-375000002.0]}, "iec-pid-text"),
]


def test_every_setting_of_every_room_has_a_case_and_no_two_settings_of_one_give_the_same():
    described = [(case.target, case.switch, tuple(case.outputs)) for case in CASES]
    assert sorted(described) == sorted((name, s.name, s.settings) for name in TARGETS for s in controller_for(name).switches
                                       if not s.chosen and s.name != "heater")  # the heater of a printer is a name in files; what a start-up leaves has no scans of its own: golden/test_s5_program
    for case in CASES:
        told = {name for s in controller_for(case.target).switches if s.name == case.switch for name in s.summary}
        differ = [outputs for setting, outputs in case.outputs.items() if setting not in told]
        assert all(one != other for one, other in combinations(differ, 2)), case


@pytest.mark.parametrize("case", CASES, ids=str)
def test_every_setting_does_what_the_source_says_of_it(case):
    for setting, outputs in case.outputs.items():
        assert case.of({case.switch: setting}) == pytest.approx(outputs, rel=1e-7), setting
    assert case.of({}) == pytest.approx(next(iter(case.outputs.values())), rel=1e-7), "the first is the default"


@pytest.mark.parametrize("target", TARGETS)
def test_no_room_starts_under_a_switch_or_setting_that_it_does_not_have(target):
    which = controller_for(target)
    words = which.encode(replace(DESIGN, sample_time_s=which.timer.round(DESIGN.sample_time_s)), Scaling())
    assert type(which).start is Controller.start
    unknown = [({"colour": "red"}, "colour")] + [({switch.name: "red"}, switch.name) for switch in which.switches]
    for given, named in unknown:
        for door in (which.start, which.start_directly):
            with pytest.raises(UnknownName, match=named):
                door(words, given)


ONE = OpenPoint(name="one", means={"no": False, "yes": True}, reason="for the test")
OTHER = OpenPoint(name="other", means={"few": 1, "many": 2}, reason="for the test")


class OneWay(NamedTuple):
    one: Annotated[bool, ONE] = False
    other: Annotated[int, OTHER] = 1


class OtherWay(NamedTuple):
    other: Annotated[int, OTHER] = 1
    one: Annotated[bool, ONE] = False


def test_the_order_of_the_fields_does_not_matter():
    assert [s.name for s in open_points_of(OneWay).values()] == ["one", "other"]
    for given in ({}, {"one": "yes"}, {"other": "many"}, {"one": "yes", "other": "many"}):
        one, other = assumptions_from(OneWay, given), assumptions_from(OtherWay, given)
        assert one._asdict() == other._asdict() == {"one": "one" in given, "other": 1 + ("other" in given)}
    assert assumptions_from(NothingOpen, {}) == ()


class Undeclared(NamedTuple):
    one: bool = False


class Twice(NamedTuple):
    one: Annotated[bool, ONE] = False
    again: Annotated[bool, ONE] = False


class NoDefault(NamedTuple):
    one: Annotated[bool, ONE]


class OtherDefault(NamedTuple):
    one: Annotated[bool, ONE] = True


class OtherKind(NamedTuple):
    other: Annotated[bool, OTHER] = True


class Alike(NamedTuple):
    one: Annotated[bool, OpenPoint(name="one", means={"no": False, "yes": False}, reason="for the test")] = False


@pytest.mark.parametrize(("wrong", "named"), [
    (Undeclared, "one: exactly one Switch"), (Twice, "two fields have one switch"), (NoDefault, "one: its default"),
    (OtherDefault, "one: its default"), (OtherKind, "other: every setting must mean a bool"), (Alike, "one: every setting"),
])
def test_a_declaration_that_contradicts_itself_is_refused(wrong, named):
    with pytest.raises(TypeError, match=named):
        open_points_of(wrong)
