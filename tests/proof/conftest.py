"""A room so simple that its answers can be worked out by hand."""

import math
from dataclasses import dataclass, field, replace
from types import SimpleNamespace

import pytest

from heatertune.model.model_values import Fopdt, TwoLag
from heatertune.pid.design_values import PidDesign, structure_of
from heatertune.plc.core import ControllerState, StepFunctions, Timing
from heatertune.plc.open_points import OpenPoint, settings_of
from heatertune.plc.words import Scaling, Words


@dataclass(frozen=True)
class TenthsRoom:
    """Reads tenths of a degree; PI in floating point whose gain word is thousandths of 1 %/°C, TN word seconds.

    `program` replaces the law: (scan number, cycle start) → power.
    """

    switches: tuple = ()
    pwm_period_s: float | None = None
    program: object = None
    overflows_above: int = 10**9
    seen: list = field(default_factory=list)
    faults: object = None
    name: str = "tenths"
    counts: int = 1000  # over 0…100 °C
    direct: object = None
    delay_s: float = 0.0
    cooling: object = None

    def check(self, words):
        assert set(words.values) == {"K", "TN"}

    def most_power_pct(self, _words):
        return 100.0

    def again_degC(self, _words):
        return None

    def forgets_degC(self, _words):
        return None

    def check_ramp(self, words):
        assert words.ramp is None or isinstance(words.ramp.step, int)

    def decode(self, words):
        gain, tn = words.values["K"] / 1000.0, float(words.values["TN"])
        return PidDesign(
            gain_pct_per_degC=gain, integral_time_s=tn, derivative_time_s=0.0, sample_time_s=words.sample_time_s,
            structure=structure_of(tn, 0.0), method="words",
        )

    def timing(self, words):
        return Timing(scan_s=words.sample_time_s, pwm_period_s=self.pwm_period_s)

    def measure(self, words, temperature_degC):
        low, high = words.scaling.low_degC, words.scaling.high_degC
        return round(10.0 * min(max(temperature_degC, low), high))

    def ends(self, words):
        return self.measure(words, words.scaling.low_degC), self.measure(words, words.scaling.high_degC)

    def ramp_degC_per_min(self, words):
        return math.inf if words.ramp is None else 6.0 * words.ramp.step / words.ramp.calls / words.sample_time_s

    def hold_degC(self, words):
        return None if words.ramp is None or words.ramp.hold is None else words.ramp.hold / 10.0

    def start(self, words, switches):
        return ControllerState((words, settings_of(self.switches, switches)), (0, 0.0))

    def start_directly(self, words, switches):
        return (self.direct or (lambda *_: (self.core, self.start(words, switches))))(words, switches)

    def sensor(self, scaling):
        return SimpleNamespace(scaling=scaling, counts=self.counts)

    def delayed_s(self, _scaling):
        return self.delay_s

    @property
    def core(self):
        return StepFunctions(step=self._step, measure=self.measure, flags=("overflow", "running"), compiles=False)

    def _step(self, parameters, state, setpoint, reading, cycle_start):
        words, switches = parameters
        count, summed = state
        self.seen.append((setpoint, reading, cycle_start))
        if self.program is not None:
            power = self.program(count, cycle_start)
        else:
            error = (setpoint - reading) / 10.0
            step = error * words.sample_time_s / words.values["TN"]
            wanted = words.values["K"] / 1000.0 * (error + summed + step)
            power = min(100.0, max(0.0, wanted))
            summed += step if power == wanted or switches.get("integral") == "never off" else 0.0
        return (count + 1, summed), power, power, (reading > self.overflows_above) + 2


@pytest.fixture
def tenths():
    return TenthsRoom()


@pytest.fixture
def switched():
    """The same with three points that its manual leaves open."""
    two = tuple(
        OpenPoint(name=name, means={"off at the limit": False, "never off": True}, reason="not told")
        for name in ("integral", "second", "third")
    )
    return replace(TenthsRoom(), switches=two)


@pytest.fixture(scope="session")
def words():
    """Make words of the tenths room."""

    def make(gain=8.0, tn=110, ta=2.0, low=0.0, high=100.0):
        return Words(
            target="tenths", values={"K": round(1000 * gain), "TN": tn}, scaling=Scaling(low_degC=low, high_degC=high),
            sample_time_s=ta,
        )

    return make


@pytest.fixture(scope="session")
def constant():
    """Make a room that asks for one power for ever."""
    return lambda power, **kept: TenthsRoom(program=lambda _count, _begins: power, **kept)


@pytest.fixture(scope="session")
def program():
    """Make a room that asks for what a function of scan number and cycle start says."""
    return lambda law, **kept: TenthsRoom(program=law, **kept)


@pytest.fixture
def heater():
    """The paper's heater, about."""
    return Fopdt(gain_degC_per_pct=0.41, time_constant_s=166.0, dead_time_s=14.0, ambient_degC=24.0)


@pytest.fixture(params=[(166.0,), (120.0, 30.0), (90.0, 90.0), (90.0, 90.0 * (1 - 1e-9))],
                ids=["one lag", "two lags", "equal lags", "nearly equal lags"])
def any_heater(request):
    first, *second = request.param
    if not second:
        return Fopdt(gain_degC_per_pct=0.5, time_constant_s=first, dead_time_s=6.5, ambient_degC=20.0)
    return TwoLag(gain_degC_per_pct=0.5, time_constant_s=first, second_time_constant_s=second[0], dead_time_s=6.5,
                  ambient_degC=20.0)
