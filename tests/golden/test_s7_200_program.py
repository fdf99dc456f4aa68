"""The exported S7-200 programs by themselves: the text in its CPU, every timed interrupt, on a heater of the test's own.

What comes out is what the proof simulated: every setpoint word and pulse width, every switching of the heater, the
temperature to a millionth of a degree, through the whole story with its restarts, whatever V memory held before.
"""

import json
import math
import re
import struct
from bisect import insort
from dataclasses import replace

import numpy as np
import pytest

from heatertune import chain
from heatertune.chain.pipeline import design
from heatertune.compiled import compile_function
from heatertune.model.model_values import Fopdt, TwoLag, model_by_hand
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Certificate, Ramp, Scaling, controller_for
from heatertune.plc.cpu.s7_200 import COLD, assemble, run
from heatertune.plc.cpu.s7_200.assembler import block_number
from heatertune.plc.cpu.s7_200.cpu import carry_out
from heatertune.plc.cpu.s7_200.io_and_cycle import own
from heatertune.proof.design_request import DesignRequest
from heatertune.settings import Conditions

FILES = {"s7-200": "s7_200_program.awl", "s7-200-pid": "s7_200_pid.awl"}


class Heater:
    """Dead time, a small lag, a large one, stepped exactly from instant to instant; all lags jump together."""

    def __init__(self, model):
        self.gain, self.dead, self.ambient = model.gain_degC_per_pct, model.dead_time_s, model.ambient_degC
        self.large, self.small = sorted((*model.lags_s, 0.0)[:2], reverse=True)
        self.now, self.y, self.x, self.held, self.coming = 0.0, self.ambient, self.ambient, {"on": 0.0, "load": 0.0, "mains": 1.0}, []

    def to(self, now):
        """Go on to an instant, through all that arrives until then."""
        while self.coming and self.coming[0][0] <= now:
            due, _, name, value = self.coming.pop(0)
            self._step(due)
            self.held[name] = self.held[name] + value if name == "load" else value
        self._step(now)

    def sends(self, at, name, value):
        """Send power, load or mains on its way."""
        insort(self.coming, (at + self.dead, len(self.coming), name, value))

    def _step(self, now):
        large = math.exp((self.now - now) / self.large)
        small = math.exp((self.now - now) / self.small) if self.small else 0.0
        end = self.ambient + self.gain * (100.0 * self.held["on"] * self.held["mains"] + self.held["load"])
        through = (self.x - end) * self.small / (self.small - self.large)
        self.y = end + (self.y - end - through) * large + through * small
        self.x, self.now = end + (self.x - end) * small, now


class Life:
    """A program in its CPU through the story of a proof's document, the nominal width at once or one cycle later.

    `before` is what each byte of V memory holds before the first start; `retains` tells whether a loss of supply leaves
    V memory as it was. What it leaves: `widths` of the PWM cycles [ms], None without supply; `temperatures` then;
    `edges`, the instants at which the heater is switched [s].
    """

    def __init__(self, text, story, model, *, before=0, retains=True, next_cycle=False):
        found = re.search(r"// sensor (\S+)\.\.\.(\S+) degC = 0\.\.\.(\d+)", text)
        self.low, high, self.full = (float(part) for part in found.groups())
        self.span, self.program, self.heater = high - self.low, assemble(text), Heater(model)
        self.ramped, self.retains, self.next_cycle = "setpoint ramp" in text, retains, next_cycle
        self.cpu = COLD.written({f"VB{byte}": before for byte in range(512)})
        self.widths, self.temperatures, self.followed, self.edges, self.supplied, self.mains = [], [], [], [], True, 1.0
        assert story["noise_degC"] == 0.0
        self.begin, self.ahead, self.asked = True, list(story["disturbances"]), story["setpoint_degC"]
        cycle = self.cycle = self._started().read("SMW68") / 1000.0
        for number in range(math.ceil(story["duration_s"] / cycle - 1e-9) + 1):
            self.lives(number * cycle)

    def lives(self, now):
        """One PWM cycle: what happens until its begin, its computation, and what the generator makes of it."""
        while self.ahead and self.ahead[0]["time_s"] <= now:
            event = self.ahead.pop(0)
            self.heater.to(event["time_s"])
            self.happens(event)
        self.heater.to(now)
        self.temperatures.append(self.heater.y)
        if not self.supplied:
            self.widths.append(None)
            self.followed.append(None)
            self._switch(now, 0.0)
            return
        self.cpu = self.cpu.written(self.inputs())
        if self.begin:
            self.cpu, self.begin = self._started(), False
        before = self.cpu.width
        self._tick()
        assert self.cpu.pulsed, "the first of its interrupts computes"
        assert self.cpu.cycle == round(1000.0 * self.cycle)
        width = before if self.next_cycle else self.cpu.width
        self.widths.append(width)
        self.followed.append(self.word())
        self._switch(now, width / 1000.0)
        for _ in range(round(1000.0 * self.cycle) // self.cpu.read("SMB34") - 1):
            self._tick()
            assert not self.cpu.pulsed, "the others count"

    def _started(self):
        """The CPU after a first scan."""
        return run(self.program, "OB1", self.cpu.written(self.inputs() | {"SM0.1": 1})).written({"SM0.1": 0})

    def _tick(self):
        """One timed interrupt, by machine code: there are hundreds of thousands."""
        self.cpu = own(self.cpu)
        compile_function(carry_out)(self.program, self.cpu.memory, block_number("INT0"), False)

    def _switch(self, now, width):
        """The output in one cycle: on for the width; it is switched where it is not in that state already."""
        if width > 0.0 and len(self.edges) % 2 == 0:
            self._edge(now)
        if width < self.cycle and len(self.edges) % 2 == 1:
            self._edge(now + width)

    def _edge(self, at):
        self.heater.sends(at, "on", 1.0 - len(self.edges) % 2)
        self.edges.append(at)

    def units(self, temperature):
        """The reading of a temperature."""
        if self.full == 32000.0:
            # whole counts stay whole: 53.3 °C of 100 are 2132, which binary fractions would make 2131
            return 8 * int(min(max((temperature - self.low) / self.span * 4000.0, 0.0), 4000.0) + 1e-9)
        return int(min(max((temperature - self.low) * 255.0 / self.span, 0.0), 255.0) + 1e-9)

    def inputs(self):
        """What sensor and panel write."""
        reading, asked = self.units(self.heater.y), self.units(self.asked)
        if self.full == 255.0:
            return {"IB0": reading & 0xFE | 1, "I1.0": reading & 1, "SMB28": asked}
        panel = {"VW80": asked} if self.ramped else {"VD104": int.from_bytes(struct.pack(">f", asked / 32000.0), "big")}
        return {"AIW0": reading} | panel

    def word(self):
        """The setpoint that the program follows."""
        return self.cpu.read("VW34" if self.full == 255.0 else "VW82") if self.ramped else self.units(self.asked)

    def happens(self, event):
        """What the proof's document says of it."""
        if "temperature_degC" in event:
            self.heater.y, self.heater.x = (at + event["temperature_degC"] for at in (self.heater.y, self.heater.x))
        elif "power_pct" in event:
            self.heater.sends(event["time_s"], "load", event["power_pct"])
        elif "setpoint_degC" in event:
            self.asked = event["setpoint_degC"]
        else:
            self.mains = event.get("share", self.mains)
            if event.get("on", self.supplied) and not self.supplied:
                kept = {f"VB{byte}": self.cpu.read(f"VB{byte}") for byte in range(512)} if self.retains else {}
                self.cpu, self.begin = COLD.written(kept), True
            self.supplied = event.get("on", self.supplied)
            self.heater.sends(event["time_s"], "mains", self.mains * self.supplied)


def assert_same(life, trace):
    """Compare with a trace of the proof, whose last edges may come after its last scan."""
    cycle = trace.words.sample_time_s
    assert life.cycle == pytest.approx(cycle)
    assert [100.0 * (width or 0) / (1000.0 * cycle) for width in life.widths] == pytest.approx(trace.power_asked_pct, abs=1e-9)
    assert np.ptp(trace.power_asked_pct) > 20.0
    scale, full = trace.words.scaling, life.full
    told = [round((word - scale.low_degC) * full / scale.span_degC) for word in trace.followed_degC]
    assert [t if word is None else word for word, t in zip(life.followed, told, strict=True)] == told
    edges = [edge for edge in life.edges if edge <= trace.time_s[-1]]
    assert edges == pytest.approx(trace.edge_time_s, abs=1e-6)
    assert np.abs(np.array(life.temperatures) - trace.temperature_degC).max() < 1e-6


@pytest.mark.long
@pytest.mark.parametrize("target", FILES)
def test_the_files_of_table4_alone_do_what_was_proven(target, tmp_path):
    proven = design("table4", DesignRequest(target=target), out=tmp_path).outcome.proof
    text, proof = (tmp_path / FILES[target]).read_text(), json.loads((tmp_path / "data" / "proof.json").read_text())
    assert proof["verdict"] == "PASS"
    assert_same(Life(text, proof["scenario"], proven.nominal.model), proven.nominal)
    next_cycle = proven.worst.switches["width_applies"] == "next_cycle"
    worst = Life(text, proof["scenario"], proven.worst.model, before=0x5A, retains=False, next_cycle=next_cycle)
    assert_same(worst, proven.worst)


QUICK = Fopdt(gain_degC_per_pct=0.6, time_constant_s=60.0, dead_time_s=3.7, ambient_degC=21.0)
TWO = TwoLag(gain_degC_per_pct=0.6, time_constant_s=50.0, second_time_constant_s=11.0, dead_time_s=1.3, ambient_degC=21.0)


@pytest.mark.long
@pytest.mark.parametrize("target", FILES)
@pytest.mark.parametrize(("heater", "gains", "ramp", "warm"), [
    (QUICK, (1.4, 50.0, 5.0, 2.0), None, {"before": 0xFF}), (QUICK, (1.4, 50.0, 5.0, 2.0), None, {"retains": False}),
    (TWO, (2.5, 40.0, 0.0, 3.0), Ramp(step=7, calls=3, hold=40), {"before": 0x5A}), (TWO, (2.5, 40.0, 0.0, 3.0), Ramp(step=2), {}),
])
def test_the_program_with_all_that_it_may_hold_does_what_was_proven_from_cold_and_from_warm(target, heater, gains, ramp, warm):
    gain, tn, tv, ta = gains
    wished = PidDesign(gain_pct_per_degC=gain, integral_time_s=tn, derivative_time_s=tv, sample_time_s=ta,
                       structure="pid" if tv else "pi", method="")
    if ramp is not None and target == "s7-200-pid":
        ramp = replace(ramp, step=125 * ramp.step, hold=None if ramp.hold is None else 125 * ramp.hold)
    words = replace(chain.encode(wished, target, scaling=Scaling(low_degC=10.0, high_degC=110.0)), ramp=ramp)
    proof = chain.prove(words, model_by_hand(heater), Conditions(setpoint_degC=51.0), first_look=True)
    told = Certificate(verdict="PASS", setpoint_degC=51.0, actuator=proof.actuator)
    text = controller_for(target).export(words, told)[FILES[target]]
    assert_same(Life(text, proof.to_document()["scenario"], proof.nominal.model, **warm), proof.nominal)
