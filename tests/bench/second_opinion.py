"""The story and its limits a second time, and the loop of second_opinion.c: a judge that shares nothing with the proof.

What it knows is what manuals and documentation say: the controllers' equations (plc/*/DIFFERENCES.md), the parts of the
story and their times (proof/test_sequence.py), what each criterion means (proof/criterion_table.py), how the exported program leads the
setpoint (weg_pid_call.st, and the same law in whole units). All is computed here anew.

What it cannot judge: margins, Ms and step power (of the words, not of a run), the ripple within a PWM period, coolers, two-level control and the program as the paper prints it, feed-forward, an interlock,
the paper's times, a story with parts left out or of another size, how far a ramp of a profile lags, a profile whose
parts are no whole PWM periods, and what an exported listing of the S7-200 does itself.
"""

import ctypes
import math
import subprocess
from dataclasses import dataclass, field, replace
from pathlib import Path

import numpy as np

SOURCE = Path(__file__).parent / "second_opinion.c"

#: target → its number in the C program, counts of the input module, seconds from temperature to reading and from output
#: to switch
TARGETS = {
    "s5-ob251": (0, 2047, 0.48), "weg": (1, 4095, 0.0), "fb41": (2, 27648, 0.256), "s7-300": (3, 27648, 0.256),
    "s7-200": (4, 255, 0.0), "s7-200-pid": (5, 4000, 0.0),
    "pid-compact": (6, 27648, 0.406),
    "klipper": (7, 3000, 0.308), "iec-pid": (8, 4095, 0.0),
    "arduino-pid": (9, 4095, 0.0), "simple-pid": (10, 4095, 0.0), "esphome": (11, 4095, 0.0),
    "marlin": (12, 1023, 0.0), "pband": (13, 10_000, 0.0),
}
#: open point → its settings in the order of their numbers, of those that a heater in automatic can meet
SWITCHES = {
    "s5-ob251": {"sum": ("unlimited", "limited"), "integral_off": ("previous_call", "same_call"),
                 "integral_inward": ("off", "on"), "rounding": ("fraction_kept", "whole_increments"),
                 "limit": ("reached", "exceeded")},
    "weg": {"anti_windup": ("clamp", "freeze", "none"), "order": ("as_printed", "by_parts"),
            "edge": ("output_zero", "runs_at_once"), "history": ("present", "zero")},
    "fb41": {"integral": ("trapezoid", "rectangle"), "derivative_lag": ("half_cycle", "whole_cycle"),
             "anti_windup": ("taken_back", "held")},
    "s7-300": {"conversion": ("rnd", "trunc"), "bias_clamp": ("adjusted", "always"), "first_reading": ("taken", "zero")},
    "s7-200": {"width_applies": ("this_cycle", "next_cycle")},
    "s7-200-pid": {"width_applies": ("this_cycle", "next_cycle")},
    "pid-compact": {"anti_windup": ("stopped", "late", "limited", "clamped"), "integral": ("backward", "forward", "trapezoid"),
                    "derivative_lag": ("backward", "tustin", "ramp", "step"), "history": ("present", "zero")},
    "klipper": {"firmware": ("klipper", "kalico", "older")},
    "iec-pid": {"time_unit": ("s", "ten_ms", "ns")},
    "esphome": {"calls": ("on_time", "late")},
    "arduino-pid": {"double": ("64bit", "32bit"), "calls": ("on_time", "late")}, "simple-pid": {"calls": ("on_time", "late")},
    "marlin": {"timer": ("1000hz", "977hz"), "history": ("all", "inside")},
    "pband": {"anti_windup": ("held", "tracking", "outside_band"), "derivative": ("reading", "error"),
              "derivative_lag": ("eighth", "quarter"), "setpoint": ("as_it_is", "filtered"), "arithmetic": ("float", "integer"),
              "reading": ("fine", "display")},
}
#: targets that make their pulses themselves, in milliseconds
OWN_PULSES = ("s7-200", "s7-200-pid", "pband")
KINDS = {"heat-up": 0, "temperature-step": 1, "load": 2, "setpoint": 3, "mains": 4, "plc": 5, "led": 6}
#: those with an integral gain: names of gain and integral gain
_PARALLEL = {"weg": ("Kp", "Ki"), "klipper": ("pid_Kp", "pid_Ki"), "arduino-pid": ("Kp", "Ki"), "simple-pid": ("Kp", "Ki"),
             "esphome": ("kp", "ki"), "marlin": ("Kp", "Ki")}
_TOO_SLOW = 20.0  # sums of lags and dead time


@dataclass(frozen=True, kw_only=True)
class Bench:
    """A heater, its switch, the words, and what is asked for.

    Attributes:
        gain, lags, dead, ambient: of the heater [°C/%, s, °C].
        target, words, low, high: of the controller.
        interval: TA [s]; its part or multiple `ratio` (a pair of whole numbers) is the PWM period.
        resolution, least_on, least_off: of the switch [s]; `carries`: what rounding leaves goes to the next period.
        settings: of the open points.
        setpoint, tolerance, noise: [°C]; `seed`: of the noise.
        ramp: step of the setpoint word, its calls, and how far from the reading it may be (0: as far as it goes), None:
            there is none.
        boost: full power until so near to the setpoint, and again from so far on [°C], None: never.
        asked_low: lower end of the setpoints of use [°C], None: a fifth of the step below the upper one.
        heats_in, recovers_in: that heat-up and disturbances may take as specified, where that is more [s].
        profile: segments (end [°C], duration of the ramp [s], of the soak [s]), in whole PWM periods and scans.
        soak_band: as specified [°C], None: the tolerance.
        soak_in_s, soak_in_share: in what time of a soak it has to be there [s], in what share, None: not told; of both
            the sooner, of none a half.
        family: the plausible heaters whose story it lives through, (gain, lags, dead time, ambient) each; none: itself.
        mains: what full power is of the rated one where the supply is as it is; its ends and none are where they are.
        sizes: by what each part's event is multiplied, of a change of mains the power; none: by nothing.
        noises: of each scan [°C]; None: drawn by the seed.
        jitter: latest delay of a scan [s]; `lates`: of each [s]; None: drawn by the seed.
        missed: calls of ten that a start-up counts as made, where each tenth is missed.
    """

    gain: float
    lags: tuple
    dead: float
    ambient: float
    target: str
    words: dict
    low: float
    high: float
    interval: float
    ratio: tuple
    resolution: float
    least_on: float
    least_off: float
    carries: bool
    settings: dict
    setpoint: float
    tolerance: float
    noise: float
    seed: int
    ramp: tuple | None = None
    boost: tuple | None = None
    asked_low: float | None = None
    heats_in: float = 0.0
    recovers_in: float = 0.0
    profile: tuple = ()
    soak_band: float | None = None
    soak_in_s: float | None = None
    soak_in_share: float | None = None
    family: tuple = ()
    mains: float = 1.0
    sizes: tuple = ()
    noises: np.ndarray | None = None
    jitter: float = 0.0
    lates: np.ndarray | None = None
    missed: int = 0

    @property
    def possible(self):
        """The heaters for which the story is told, each a bench."""
        return [replace(self, gain=gain, lags=lags, dead=dead, ambient=ambient, family=(), mains=1.0, sizes=())
                for gain, lags, dead, ambient in self.family] or [self]

    @property
    def period(self):
        """PWM period [s]."""
        return self.interval * self.ratio[0] / self.ratio[1]

    @property
    def slow(self):
        """Sum of lags and dead time [s]."""
        return sum(self.lags) + self.dead

    @property
    def power(self):
        """Power that holds the setpoint, of what the supply gives [%]."""
        return (self.setpoint - self.ambient) / (self.gain * self.mains)

    @property
    def band(self):
        """How far from the setpoint is right [°C]: nobody sees less than two counts."""
        return max(self.tolerance, 2.0 * (self.high - self.low) / TARGETS[self.target][1])

    @property
    def integral_time(self):
        """TN as the words make it [s], infinite without an integral part."""
        w, ta = self.words, self.interval
        if self.target == "s5-ob251":
            return ta * w["R"] / w["TI"] if w["TI"] else math.inf
        if self.target in _PARALLEL:
            gain, integral = (w[name] for name in _PARALLEL[self.target])
            return (1.0 if self.target == "weg" else gain) / integral if integral else math.inf
        if self.target == "fb41":  # its trapezoids are rectangles half an interval shorter
            return w["TI"] / 1000.0 - ta / 2.0 if w["I_SEL"] else math.inf
        if self.target in ("s7-300", "pid-compact", "iec-pid", "pband"):
            name, unit = {"s7-300": ("RESET", 1e-3), "pid-compact": ("Ti", 1.0), "iec-pid": ("TR", 1.0), "pband": ("ti", 1.0)}[self.target]
            return w[name] * unit or math.inf
        if self.target == "s7-200":  # KI acts on the sum of two errors
            return ta * (w["KP"] - w["KI"]) / (2.0 * w["KI"]) if w["KI"] else math.inf
        return 60.0 * w["TI"] * ta / w["TS"] if w["TI"] < 1e38 else math.inf


@dataclass
class Part:
    """A part of the story: its event, how long it may take, how long it then rests [s], and what it is judged as.

    `begins_at`: setpoint at its begin, where it is led to `asked` [°C].
    """

    event: str
    value: float
    takes: float
    rest: float
    kind: str
    up: bool = True
    asked: float = 0.0
    power: float = 1.0
    supplied: bool = True
    begins_at: float = 0.0


def story(b):
    """Return the parts of a bench's story, in order, with its own mains and sizes; see `_told`."""
    parts = list(_told(b))
    if b.mains != 1.0:  # what is not at an end of the supply's tolerance, and no open circuit, is as the supply is
        parts = [replace(part, power=b.mains) if part.power == 1.0 else part for part in parts]
    if not b.sizes:
        return parts
    return [replace(part, power=size * part.power) if part.event == "mains" else replace(part, value=size * part.value)
            for part, size in zip(parts, b.sizes, strict=True)]


def _told(b):
    """Return the parts as the documentation of proof/test_sequence.py tells each, in the times of the plausible heaters."""
    every = b.possible
    slow, step, power = (max(each) for each in zip(*((h.slow, h.setpoint - h.ambient, h.power) for h in every), strict=True))
    tn = min(b.integral_time, _TOO_SLOW * slow) if math.isfinite(b.integral_time) else slow
    calm = max(b.period, 2.0 * math.pi * tn)
    calm = max(calm, min(_beat(b), 10.0 * calm))
    loop = 5.0 * slow
    recovers = max(loop, b.recovers_in)
    ramp = 0.0 if b.ramp is None else step / _degrees_per_second(b)
    way = max(_takes(h, h.power / 100.0) for h in every) + loop + ramp
    yield Part("heat-up", 0.0, max(way, b.heats_in), 10.0 * calm, "heat-up", asked=b.setpoint)
    state = {"asked": b.setpoint, "power": 1.0, "supplied": True}

    def part(event, value, kind, up=True, takes=recovers, rest=calm, **changed):
        state.update(changed)
        return Part(event, value, takes, rest, kind, up, **state)

    yield part("temperature-step", -0.3 * step, "recovery", up=False)
    load = min(10.0, 95.0 - power)
    if load > 0.0:
        yield part("load", -load, "recovery", up=False, rest=10.0 * calm)
        yield part("load", load, "recovery")
    for event, value, kind, seconds, share in _circuits(b, tn):
        yield part(event, value, kind, takes={"reheat": way, "recovery": recovers}.get(kind, seconds),
                   rest=0.0 if kind == "off" else calm, power=share)
    low = b.setpoint - 0.2 * step if b.asked_low is None else b.asked_low
    if all(h.ambient < low < b.setpoint for h in every):
        cools = max(_takes(h, (b.setpoint - low) / (b.setpoint - h.ambient)) for h in every)
        yield part("setpoint", 0.0, "change", up=False, takes=cools + loop + ramp, rest=10.0 * calm, asked=low)
        yield part("setpoint", 0.0, "change", takes=way, asked=b.setpoint)
        for asked, up in _small_changes(b, low, step):
            yield part("setpoint", 0.0, "small-change", up=up, takes=loop + ramp, asked=asked)
    if power / 0.81 <= 95.0:
        for share, up, rest in ((0.81, False, 10.0), (1.21, True, 10.0), (1.0, False, 1.0)):
            yield part("mains", 0.0, "recovery", up=up, rest=rest * calm, power=share)
    for off in (0.1 * slow, max(_takes(h, 0.95) for h in every)):
        yield part("plc", 0.0, "off", takes=off, rest=0.0, power=0.0, supplied=False)
        yield part("plc", 0.0, "restart", takes=way, power=1.0, supplied=True)
    if b.profile:
        near = 0.5 * (b.tolerance if b.soak_band is None else b.soak_band)
        off = max(_takes(h, 1.0 - min(0.05, near / step)) for h in every)
        yield part("plc", 0.0, "off", takes=off, rest=0.0, power=0.0, supplied=False)
        yield from _along(b)


def _small_changes(b, low, step):
    """Return the setpoints of the small changes, and whether each leads up: 5 and 10 % of the step, or 2 and 4 bands."""
    small = max(0.05 * step, 2.0 * b.band)
    return [each for change in (small, 2.0 * small) if change <= b.setpoint - low
            for each in ((b.setpoint - change, False), (b.setpoint, True))]


def _circuits(b, tn):
    """Return event, value, kind, duration of what is "off" [s] and share of the power, of all that is told of open circuits."""
    every, back = b.possible, ("mains", 0.0, "reheat", 0.0, 1.0)
    for opened in (max(2.0 * tn, *(h.slow for h in every)), max(10.0 * tn, *(_takes(h, 0.95) for h in every))):
        yield from (("mains", 0.0, "off", opened, 0.0), back)
    again = b.boost[1] if b.boost else math.inf
    out = math.inf
    if b.target == "marlin":  # its window begins at the setpoint in whole degrees, and the reading has steps
        unsure = 0.5 + (b.high - b.low) / 1023.0
        again, out = b.words["PID_FUNCTIONAL_RANGE"] - unsure, b.words["PID_FUNCTIONAL_RANGE"] + unsure
    # the way down to where full power takes it back; while the circuit's dead time lasts, the reading does not fall
    longest = max(b.interval, b.period)
    nearly = [seconds - 2.0 * longest for seconds in _falls(every, again)]
    if nearly and nearly[1] - nearly[0] <= longest:  # the fastest heater is as fast as the slowest
        del nearly[0]
    for seconds in nearly:
        if seconds > 0.0:
            yield from (("mains", 0.0, "off", seconds, 0.0), back)
    if falls := _falls(every, out):  # out of the window, the sum gone, twice, with up to 1 % of the power taken away: there it may stay
        little = min(1.0, (100.0 - max(h.power for h in every)) / 2.0)
        yield from (("mains", 0.0, "off", falls[0], 0.0), ("load", -little, "off", max(h.dead for h in every), 0.0), back)
        yield from (("mains", 0.0, "off", falls[1], 0.0), back, ("load", little, "recovery", 0.0, 1.0))


def _falls(every, distance):
    """Return in what time the fastest and the slowest heater fall so far, the dead time left out; none: no way is so long."""
    ways = [h.setpoint - h.ambient for h in every]
    if distance >= max(ways):
        return []
    falls = [_takes(h, distance / way if distance < way else 0.95) - h.dead for h, way in zip(every, ways, strict=True)]
    return [min(falls), max(falls)]


def _along(b):
    """Return the ramps and soaks of the profile, from the ambient on."""
    at = b.possible[0].ambient
    for end, ramp, soak in b.profile:
        yield Part("led", 0.0, ramp, 0.0, "ramp", end > at, end, begins_at=at)
        if soak > 0.0:
            given = [each for each in (b.soak_in_s, b.soak_in_share and b.soak_in_share * soak) if each is not None]
            rest = max(0.0, soak - min(given, default=0.5 * soak))
            yield Part("led", 0.0, soak - rest, rest, "soak", True, end, begins_at=end)
        at = end


def ends_of(b, parts):
    """Return when each part ends [ticks]: whole PWM periods, in whole scans."""
    scan, grid, ends = b.ratio[1], max(b.ratio), [0]
    tick = b.interval / scan
    for part in parts:
        periods = math.ceil((part.takes + part.rest) / (grid * tick) - 1e-9)
        ends.append(ends[-1] + scan * math.ceil(periods * grid / scan))
    return ends[1:]


def _beat(b):
    short, long = sorted((b.period, b.interval))
    apart = abs(long - round(long / short) * short)
    return long * short / apart if apart > 1e-6 * short else 0.0


def _degrees_per_second(b):
    step, calls, _ = b.ramp
    unit = 1.0 if b.target in ("weg", "pid-compact", "klipper", "iec-pid") else (b.high - b.low) / TARGETS[b.target][1]
    return step * unit / (8.0 if b.target == "s7-200-pid" else 1.0) / calls / b.interval


def _takes(b, share):
    """Return the time in which the heater does a share of a step's way [s]."""
    def left(t):
        if len(b.lags) == 1:
            return math.exp(-t / b.lags[0])
        one, two = b.lags
        if one - two < 1e-4 * one:  # equal lags
            return (1.0 + t / one) * math.exp(-t / one)
        return (one * math.exp(-t / one) - two * math.exp(-t / two)) / (one - two)

    low, high = 0.0, 100.0 * sum(b.lags)
    for _ in range(100):
        middle = 0.5 * (low + high)
        low, high = (middle, high) if left(middle) > 1.0 - share else (low, middle)
    return b.dead + high


class _Case(ctypes.Structure):
    _fields_ = (
        ("target", ctypes.c_int), ("sw", ctypes.c_int * 8), ("words", ctypes.c_double * 16),
        ("low", ctypes.c_double), ("span", ctypes.c_double), ("counts", ctypes.c_double),
        ("scan", ctypes.c_int64), ("period", ctypes.c_int64), ("tick", ctypes.c_double),
        ("resolution", ctypes.c_double), ("least_on", ctypes.c_double), ("least_off", ctypes.c_double),
        ("carries", ctypes.c_int),
        *((name, ctypes.c_double) for name in ("gain", "lag", "inner", "dead", "ambient", "start", "per_lag", "per_inner", "ramp", "hold")),
        ("ramp_calls", ctypes.c_int64), ("within", ctypes.c_double), ("again", ctypes.c_double), ("phases", ctypes.c_int),
        ("begin", ctypes.c_void_p), ("rest", ctypes.c_void_p), ("kind", ctypes.c_void_p), ("value", ctypes.c_void_p),
        ("asked", ctypes.c_void_p), ("from", ctypes.c_void_p), ("power", ctypes.c_void_p), ("supplied", ctypes.c_void_p),
        ("band", ctypes.c_double), ("noise", ctypes.c_void_p), ("noises", ctypes.c_int64), ("sigma", ctypes.c_double),
        ("late", ctypes.c_void_p), ("lates", ctypes.c_int64), ("longer", ctypes.c_double),
        ("before", ctypes.c_int64), ("added", ctypes.c_double),
    )


FOUND = ("highest", "lowest", "absolute", "settled", "rest_integral", "rest_highest", "rest_lowest", "later_highest",
         "later_lowest", "later_mean", "later_swing", "later_s", "repeats")


_LOADED = []


def compiled(folder):
    """Return the C program, compiled once in a process; raise FileNotFoundError where there is no compiler.

    Not with GCC's vectors of straight code: GCC 12 leaves out a rounding to float there, of arduino's OutMax.

    Args:
        folder: where the first call puts it.
    """
    if not _LOADED:
        library = Path(folder) / "second_opinion.so"
        subprocess.run(["cc", "-O3", "-fno-tree-slp-vectorize", "-ffp-contract=off", "-shared", "-fPIC", "-o", str(library), str(SOURCE),
                        "-lm"], check=True)
        _LOADED.append(ctypes.CDLL(str(library)))
    return _LOADED[0]


@dataclass
class Opinion:
    """What the judge saw.

    Attributes:
        parts: of the story.
        begins: of each part and the end [s].
        seen: per part, see `FOUND`; temperatures from the setpoint [°C].
        values: criterion → its value and limit, those of the part that uses most of it; what has no limit but is told
            stands at an infinite one.
        iae: over all parts but those without heater or PLC [°C·s].
        later: what the rests do after the story, of the band: "hunts" farthest, "drifts" in the mean, "swings".
    """

    parts: list
    begins: list
    seen: list = field(default_factory=list)
    values: dict = field(default_factory=dict)
    iae: float = 0.0
    later: dict = field(default_factory=dict)


def _numbers(b):
    order = {"s5-ob251": ("K", "R", "TI", "TD", "BGOG", "BGUG"), "weg": ("Kp", "Ki", "Kd", "Ts", "MaximumOutput"),
             "fb41": ("GAIN", "TI", "TD", "TM_LAG", "CYCLE", "PV_FAC", "PV_OFF", "I_SEL", "D_SEL", "LMN_HLM"),
             "s7-300": ("GAIN", "RATE", "RESET", "SAMPLE"),
             "pid-compact": ("Gain", "Ti", "Td", "TdFiltRatio", "Cycle", "OutputUpperLimit"), "s7-200": ("KP", "KI", "KD", "SCALE"),
             "s7-200-pid": ("KC", "TS", "TI", "TD"),
             "klipper": ("pid_Kp", "pid_Ki", "pid_Kd", "max_power", "smooth_time"),
             "arduino-pid": ("Kp", "Ki", "Kd", "OutMax", "Full", "SampleTime"),
             "simple-pid": ("Kp", "Ki", "Kd", "output_max", "PERIOD_MS"),
             "esphome": ("kp", "ki", "kd", "min_integral", "max_integral", "update_interval"),
             "iec-pid": ("KP", "TR", "TD", "XMIN", "XMAX", "CYCLE"),
             "marlin": ("Kp", "Ki", "Kd", "PID_MAX", "PID_FUNCTIONAL_RANGE", "PID_K1", "ADC_LOOPS"),
             "pband": ("Pb", "ti", "td", "OPH")}[b.target]
    numbers = [float(b.words[name]) for name in order]
    if b.target == "pband":  # both in tenths
        return [numbers[0] / 10.0, *numbers[1:3], numbers[3] / 10.0, b.interval]
    return [*numbers, float(b.words["TICK"] * b.words["TICKS"])] if b.target.startswith("s7-200") else numbers


def opinion(library, b, limits, *, longer):
    """Return what the judge sees: the story, and its rests gone on with for `longer` times the whole story altogether.

    Args:
        library: of `compiled`.
        b: a bench.
        limits: name → number, as `LIMITS` has them.
        longer: 0: the story alone.
    """
    told, case, held = _prepared(b)
    case.longer = longer / sum(part.rest > 0.0 and part.event != "led" for part in told.parts)
    table, totals = np.zeros((len(told.parts), len(FOUND))), np.zeros(4)
    if library.second_opinion(ctypes.byref(case), _place(table), _place(totals)):
        raise RuntimeError("too many pulses were under way")
    del held
    _counted(told, b, limits, *totals)
    return _seen(told, b, table, limits)


def in_plain_steps(library, b, limits, edges, *, step=1e-3):
    """Return what plain steps of so many seconds give, the instants being known at which the heater is switched."""
    told, case, held = _prepared(b)
    table, edges = np.zeros((len(told.parts), len(FOUND))), np.ascontiguousarray(edges, dtype=np.float64)
    library.plain_steps(ctypes.byref(case), _place(edges), ctypes.c_int64(len(edges)), ctypes.c_double(step), _place(table))
    del held
    return _seen(told, b, table, limits)


def _place(array):
    return ctypes.c_void_p(array.ctypes.data)


def _prepared(b):
    """Return an opinion without anything seen, what the C program is given, and what must be kept for it."""
    number, counts, delay = TARGETS[b.target]
    parts, (numer, denom) = list(story(b)), b.ratio
    tick, begins = b.interval / denom, [0, *ends_of(b, parts)]
    rests = [end * tick - part.rest for end, part in zip(begins[1:], parts, strict=True)]
    noise = np.zeros(0) if b.noises is None else b.noises
    if b.noise and b.noises is None:
        noise = np.random.default_rng(b.seed).normal(0.0, b.noise, begins[-1] // denom + 2)
    late = np.zeros(0) if b.lates is None else b.lates
    if b.jitter and b.lates is None:
        late = np.random.default_rng([b.seed, 1]).uniform(0.0, b.jitter, begins[-1] // denom + 2)
    held = {
        "begin": np.array(begins, dtype=np.int64), "rest": np.array(rests),
        "kind": np.array([KINDS[part.event] for part in parts], dtype=np.int32),
        "value": np.array([part.value for part in parts]), "asked": np.array([part.asked for part in parts]),
        "from": np.array([part.begins_at for part in parts]), "power": np.array([part.power for part in parts]),
        "supplied": np.array([part.supplied for part in parts], dtype=np.int32), "noise": noise, "late": late,
    }
    settings = [choices.index(b.settings[name]) for name, choices in SWITCHES[b.target].items()]
    ramp, calls, hold = (0.0, 1, 0.0) if b.ramp is None else b.ramp
    lag, inner = (*b.lags, 0.0)[:2]
    case = _Case(
        target=number, sw=(ctypes.c_int * 8)(*settings), words=(ctypes.c_double * 16)(*_numbers(b)), low=b.low,
        span=b.high - b.low, counts=counts, scan=denom, period=numer, tick=tick, resolution=b.resolution,
        least_on=b.least_on, least_off=b.least_off, carries=b.carries, gain=b.gain, lag=lag, inner=inner,
        dead=b.dead + delay, ambient=b.ambient, start=b.ambient, per_lag=1.0 / lag,
        per_inner=1.0 / inner if inner else 0.0, ramp=ramp, hold=hold, ramp_calls=calls,
        within=b.boost[0] if b.boost else 0.0, again=b.boost[1] if b.boost else 0.0, phases=len(parts), band=b.band,
        noises=len(noise), sigma=b.noise, lates=len(late), before=b.missed,
        **{name: array.ctypes.data if len(array) else None for name, array in held.items()})
    return Opinion(parts, [begin * tick for begin in begins]), case, held


def _seen(told, b, table, limits):
    told.seen = [dict(zip(FOUND, row, strict=True)) for row in table.tolist()]
    _judged(told, b, limits)
    return told


_NAMES = {"heat-up": ("overshoot", "settling_time"), "change": ("change_overshoot", "change_time"),
          "small-change": ("small_change_overshoot", "small_change_time"),
          "reheat": ("reheat_overshoot", "reheat_time"), "restart": ("restart_overshoot", "restart_time"),
          "recovery": ("recovery_overshoot", "recovery_time")}


def _enter(told, name, value, limit):
    """Enter a criterion's value where none uses more of its limit; None: nothing is asked for."""
    limit = math.inf if limit is None else limit
    before, its = told.values.get(name, (-math.inf, 1.0))
    if (value / limit, value) > (before / its, before):
        told.values[name] = value, limit


def _judged(told, b, limits):
    """Enter the worst value of each criterion."""
    asked = b.setpoint
    for part, seen, begin, end in zip(told.parts, told.seen, told.begins, told.begins[1:], strict=False):
        if part.kind == "off" or part.event == "led":
            continue
        beyond, time = _NAMES[part.kind]
        asked, before = part.asked, asked  # by how much the setpoint changes
        above = part.up != (part.kind == "recovery")  # what a disturbance pushes up is overshot below
        over, under = (max(0.0, each) for each in (seen["highest"], -seen["lowest"]))
        over, under = (over, under) if above else (under, over)
        way = abs(asked - before) if part.kind == "small-change" else b.setpoint - b.ambient
        _enter(told, beyond, over / way * 100.0, limits[beyond])
        _enter(told, f"{beyond} in degC", over, limits.get(f"{beyond} in degC"))
        if part.kind == "recovery":
            _enter(told, "deviation", under, limits.get("deviation"))
        _enter(told, time, seen["settled"] - begin, limits.get(time) or end - part.rest - begin)
        _enter(told, "steady_offset", abs(seen["rest_integral"]) / part.rest, b.band)
        _enter(told, "limit_cycle", (seen["rest_highest"] - seen["rest_lowest"]) / 2.0, b.band)
        told.iae += seen["absolute"]
        if seen["later_s"] > 0.0:
            later = {"hunts": max(seen["later_highest"], -seen["later_lowest"]), "drifts": abs(seen["later_mean"]),
                     "swings": seen["later_swing"]}
            for name, value in later.items():
                told.later[name] = max(told.later.get(name, 0.0), value / b.band)
    _enter(told, "iae", told.iae, limits.get("iae"))
    _judged_along(told, b, limits)


def _judged_along(told, b, limits):
    """Enter the criteria of the profile; how far a ramp lags is not looked at."""
    led = [(part, seen) for part, seen in zip(told.parts, told.seen, strict=True) if part.event == "led"]
    for number, (part, seen) in enumerate(led):
        _enter(told, "peak", part.asked + seen["highest"], limits.get("peak"))
        if part.kind == "soak":
            if part.rest > 0.0:
                _enter(told, "soak_deviation", max(seen["rest_highest"], -seen["rest_lowest"]),
                       b.band if b.soak_band is None else b.soak_band)
            continue
        beyond = [seen]
        for later, its in led[number + 1:]:
            if later.kind == "ramp" and later.up == part.up:
                break
            beyond.append(its | {name: its[name] + later.asked - part.asked for name in ("highest", "lowest")})
            if later.kind == "ramp":
                break
        over = max(0.0, *(each["highest"] if part.up else -each["lowest"] for each in beyond))
        _enter(told, "ramp_overshoot", over / abs(part.asked - part.begins_at) * 100.0, limits["overshoot"])
        _enter(told, "ramp_overshoot in degC", over, limits.get("overshoot in degC"))


def _counted(told, b, limits, scans, limited, faults, pulses):
    """Enter what is counted over the whole story."""
    _enter(told, "saturation", limited / scans * 100.0, limits.get("saturation"))
    lasts = [(part, end - begin) for part, begin, end in zip(told.parts, told.begins, told.begins[1:], strict=False)]
    closed = sum(each for part, each in lasts if part.kind != "off")
    between = sum(each for part, each in lasts if part.supplied) * (1.0 - limited / scans)
    often = max(pulses / closed, pulses / between if between else 0.0)
    _enter(told, "switchings", 3600.0 * min(often, 1.0 / b.period), limits.get("switchings"))
    _enter(told, "power held", b.power, limits.get("power held"))
    told.values["overflow"] = (math.inf, 1.0) if faults else (0.0, 1.0)
