"""What the stages are told: every option of reading, fitting, tuning and proving, once, see `heatertune.options`."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Final

from heatertune.codec import register_schema
from heatertune.errors import InputError, OutOfRange
from heatertune.options import option, options_of, validate_options

__all__ = [
    "RECORD_SCHEMA", "STEP_POWER_PCT", "AsLeftSettings", "Conditions", "FeedForwardSettings", "FitSettings",
    "ReadSettings", "RecordSettings", "SampleSettings", "SensorSettings", "TuneSettings", "ValidateSettings",
    "WordSettings", "refuse_unused_limits",
]


#: most power that one step of the reading may move, where nothing is said [%]
STEP_POWER_PCT: Final = 10.0
_COLDEST_DEGC: Final = -273.15
_COLUMN: Final = "NAME|N"


def _step_power(instead: str) -> Any:
    return option(
        None, float, "largest change of the power by one step of the reading, or by its noise", unit="%",
        flag="--step-power", above=0.0, infinite=True, instead=(instead, ""))


def _time(default: float | None, what: str, flag: str, **more: Any) -> Any:
    return option(default, float, what, unit="s", flag=flag, **({"least": 0.0} | more))


@dataclass(frozen=True, slots=True, kw_only=True)
class ReadSettings:
    """How to read a log file; unset options are detected, see `heatertune.log.read_log`.

    Attributes:
        time_column: name or number (1 = first) of the time column; the same for the other columns.
        temperature_column: of the temperature; of a long table, of the values.
        power_column: of the heater power; "none": there is none; the same for other optional columns and tags.
        run: which of several runs in one file, 1 = first; None: the longest.
        skip_empty: whether rows without a temperature are left out instead of refused.
    """

    time_column: str | int | None = option(None, str, "column of the time", flag="--time-column", metavar=_COLUMN)
    temperature_column: str | int | None = option(
        None, str, "column of the temperature", flag="--temperature-column", metavar=_COLUMN)
    power_column: str | int | None = option(
        None, str, "column of the heater power; none: no such column", flag="--power-column", metavar=_COLUMN)
    power_log: str | None = option(
        None, str, "file of the power, if it has one of its own", flag="--power-log", metavar="FILE")
    setpoint_column: str | int | None = option(
        None, str, "column of the setpoint; none: no such column", flag="--setpoint-column", metavar=_COLUMN)
    disturbance_column: str | int | None = option(
        None, str, "column of a measured load (a flow, a fan, a door) whose effect is fitted; none: no such column",
        flag="--disturbance-column", metavar=_COLUMN)
    cooling_column: str | int | None = option(
        None, str, "column of a cooler's power; none: no such column", flag="--cooling-column", metavar=_COLUMN)
    ambient_column: str | int | None = option(
        None, str, "column of the room's temperature; none: no such column", flag="--ambient-column", metavar=_COLUMN)
    date_column: str | int | None = option(
        None, str, "column of the date, if the time column contains only times of "
                   "day", flag="--date-column", metavar=_COLUMN)
    temperature_unit: str | None = option(
        None, str, "unit of the temperature", flag="--temperature-unit",
        choices=("degC", "degF", "K", "0.1degC", "0.01degC", "0.1degF"))
    temperature_scale: float | None = option(
        None, float, "factor from a reading to its unit, 0.1 for tenths", flag="--temperature-scale", metavar="X",
        above=0.0)
    power_full_scale: float | None = option(
        None, float, "reading at full power: 1, 100, 255 …", flag="--power-full-scale", metavar="X", above=0.0)
    power_levels: tuple[float, float] | None = option(
        None, float, "readings without power and at full power: 4 20, 1 5, -100 100 …", flag="--power-levels",
        pair=("OFF", "FULL"))
    power_on: str | None = option(
        None, str, "cell of a switched power that means on, other words mean off; a row with a blank or a word for no "
                   "value is left out, unless the column has no other word for off", flag="--power-on", metavar="WORD")
    time_unit: str | None = option(
        None, str, "unit of the time", flag="--time-unit",
        choices=("s", "ms", "us", "ns", "min", "h", "d", "mm:ss", "hh:mm"))
    sample_time_s: float | None = option(
        None, float, "interval of a log without time column", unit="s", flag="--log-interval", above=0.0)
    decimal_comma: str | None = option(
        None, str, "columns whose numbers have decimal commas that also separate the cells: their numbers (1 = first) "
                   "or names, with commas between them; none: no column", flag="--decimal-comma", metavar="COLUMNS")
    tag: str | None = option(
        None, str, "tag of the temperature, if the file has rows of several tags", flag="--tag", metavar="NAME")
    power_tag: str | None = option(
        None, str, "tag of the power in such a file; none: no such tag", flag="--power-tag", metavar="NAME")
    setpoint_tag: str | None = option(
        None, str, "tag of the setpoint in such a file; none: no such tag", flag="--setpoint-tag", metavar="NAME")
    tag_column: str | int | None = option(None, str, "column of the tags", flag="--tag-column", metavar=_COLUMN)
    quality_column: str | int | None = option(
        None, str, "column of the quality flags; none: ignore them", flag="--quality-column", metavar=_COLUMN)
    skip_rows: int = option(0, int, "skip the first N lines of the file", flag="--skip-rows", metavar="N", least=0.0)
    run: int | None = option(
        None, int, "which of several runs in one file", flag="--run", dest="which_run", metavar="N",
        instead=("the longest", ""))
    skip_empty: bool = option(False, bool, "leave out rows without a temperature (empty, NaN)", flag="--skip-empty")
    errata: bool = option(False, bool, "correct the known misprints of a built-in table", flag="--errata")

    def __post_init__(self) -> None:
        validate_options(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class FitSettings:
    """What is known beside a log that is fitted, see `heatertune.model.fit.fit`."""

    ambient_degC: float | tuple[float, float] | None = option(
        None, float, "ambient temperature, if it is known", unit="°C", flag="--ambient",
        help="ambient temperature [°C]: its value, or its lowest and highest possible value; after LOG",
        several=True, least=_COLDEST_DEGC)
    power_before_pct: float | None = option(
        None, float, "power before the log's first reading", unit="%", flag="--power-before",
        help="power before the first reading [%]", least=0.0, most=100.0)
    from_s: float | None = option(
        None, float, "first instant of the log to use", unit="s", flag="--from", dest="from_s",
        help="first instant to use [s]; default: the first reading")
    until_s: float | None = option(
        None, float, "last instant of the log to use", unit="s", flag="--until",
        help="last instant to use [s]; default: up to a jump")
    dead_time_at_most_s: float | None = _time(
        None, "longest dead time, if you know one", "--dead-time-at-most",
        help="longest dead time, if you know one [s]; stated in the certificate")
    sensor_delay_s: float = _time(0.0, "known delay of the sensor", "--sensor-delay", instead=("0", ""))
    log_pwm_period_s: float | None = _time(
        None, "PWM period of the heater while it was logged", "--log-pwm-period", instead=("the log's", ""))
    thermostat: tuple[float, ...] | None = option(
        None, float, "thresholds of the two-level control that made a log without power", unit="°C",
        flag="--thermostat", metavar="X", several=True, label="thermostat", least=_COLDEST_DEGC,
        help="LOW HIGH: the temperatures [°C] at which the two-level control of a log without power switches on and "
             "off; then, if it has any, its minimum on and off times [s]")
    largest_power_pct: float | None = option(
        None, float, "largest power in a log that does not contain the power", unit="%", flag="--largest-power",
        metavar="PCT", above=0.0, most=100.0,
        help="largest power [%] that the heater got in a log without power; 100 if it was fully on for a while")
    cooler: bool = option(False, bool, "the power cools: more power, lower temperature", flag="--cooler")
    alone: bool = option(
        False, bool, "no other heater heats the slow mass of a heater of two time scales", flag="--alone")

    def __post_init__(self) -> None:
        validate_options(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class ValidateSettings:
    """How a model is judged by another log, see `heatertune.model.validate.validate`."""

    ambient_degC: float | None = option(
        None, float, "ambient during this log", unit="°C", flag="--ambient", least=_COLDEST_DEGC,
        instead=("the model's own", ""))
    power_before_pct: float | None = option(
        None, float, "power before the first reading", unit="%", flag="--power-before", least=0.0, most=100.0)
    until_s: float | None = option(
        None, float, "last instant of the log to use", unit="s", flag="--until",
        help="last instant to use [s]; default: up to a jump")
    least_fit_pct: float = option(
        80.0, float, "fit that every model must reach", unit="%", flag="--least-fit", most=100.0, instead=("80", ""))

    def __post_init__(self) -> None:
        validate_options(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class TuneSettings:
    """What a design is asked for, see `heatertune.pid.tune.tune`.

    Attributes:
        sample_time_s: TA [s]; None: TRdom/10, found with the design; 0: continuous.
        robust: over which heaters drawn from the fit the limits hold besides the candidates; TA is that of the design
            without them.
    """

    structure: str = option(
        "pi", str, "parts of the controller", flag="--structure", choices=("p", "pi", "pid"), instead=("pi", ""))
    method: str = option(
        "optimum", str, "optimum or a rule", flag="--method", metavar="NAME",
        help="optimum (default), or a rule: simc, simc-improved, lambda, imc, haalman, amigo, "
             "ziegler-nichols, ziegler-nichols-ultimate, cohen-coon, chr-{setpoint,load}-{0,20}, tyreus-luyben, "
             "lopez-{iae,ise,itae}, rovira-{iae,itae}, usort-{load,setpoint}-{2.0,1.8,1.6,1.4}")
    closed_loop_s: float | None = option(
        None, float, "closed-loop time constant of a rule", unit="s", flag="--closed-loop",
        help="closed-loop time constant: τc of simc and simc-improved, λ of lambda and imc [s]",
        instead=("the rule's own", ""))
    objective: str = option(
        "load", str, "what the optimum minimises", flag="--objective",
        choices=("load", "setpoint", "itae", "ki", "iae", "ise"),
        help="what the optimum minimises: IAE after a load step (load or iae; default) or a setpoint step, ITAE or ISE "
             "after a load step; ki: largest integral gain")
    weight: float | None = option(
        None, float, "share of the setpoint IAE", flag="--weight", metavar="W",
        help="with the objective load: weight of the setpoint IAE in the cost, 0 to 1", least=0.0, most=1.0)
    mt: float = option(
        math.inf, float, "largest Mt of the optimum", flag="--mt", above=0.0, infinite=True, instead=("no limit", ""))
    mks: float = option(
        math.inf, float, "largest Mks of the optimum", unit="%/°C", flag="--mks",
        help="largest noise gain Mks from reading to power [%/°C]", above=0.0, infinite=True, instead=("no limit", ""))
    ms: float = option(
        1.6, float, "largest Ms of the optimum", flag="--ms", help="largest sensitivity peak Ms; of the optimum",
        above=1.0, most=4.0, instead=("1.6", ""))
    robust: str = option(
        "none", str, "on which drawn heaters the limits of the optimum hold too", flag="--robust",
        choices=("none", "p95", "worst"),
        help="keep the limits of the optimum also on heaters sampled from the fit's intervals: on 95 % of them, or all "
             "(default: none; their worst values are reported)")
    sample_time_s: float | None = option(
        None, float, "sampling interval TA", unit="s", flag="--sample-time", automatic=("auto", "words"), least=1e-3,
        or_zero=True,
        help="sampling interval TA [s]; auto: TRdom/10 (default); words: near that, where rounding costs least; 0: "
             "continuous")
    step_power_pct: float | None = _step_power(f"{STEP_POWER_PCT:g}")

    def __post_init__(self) -> None:
        validate_options(self)
        object.__setattr__(self, "method", str(self.method).lower())


def refuse_unused_limits(settings: TuneSettings) -> None:
    """Refuse limits and costs that a user states for a rule, which does not look at them.

    Raises:
        InputError: one of them differs from its default.
    """
    stated = [one.flag for name, one in options_of(TuneSettings).items()
              if name in ("objective", "weight", "mt", "mks", "ms") and getattr(settings, name) != one.default]
    if stated and settings.method != "optimum":
        raise InputError(f"the rule {settings.method} does not look at {' and '.join(stated)}: leave that out, or "
                         "leave out --method for the optimum")


@dataclass(frozen=True, slots=True, kw_only=True)
class WordSettings:
    """How a design becomes words, see `heatertune.proof.redesign.DesignRequest`.

    Attributes:
        words_by: how the words are found, see `heatertune.plc.word_selection.choose_words`.
        switch_kind: the PWM period is proposed for it, see `heatertune.proof.design_request.with_pwm`;
            a given one stays.
        refined: whether the gains are refined in the loop of the proof, see `heatertune.proof.refine.refine`.
        setpoint_ramp: [°C/min], "auto" or "none", see `heatertune.proof.setpoint_ramp.prove_ramped`; None: as the words
            have it; of a design, where nothing else helps.
        boost: "auto" or "none", see `heatertune.proof.redesign.redesign_search`.
        as_is: the plain design, even where another one would pass, see `heatertune.proof.redesign.find_passing_design`.
    """

    words_by: str = option(
        "auto", str, "how the words are found", flag="--words", choices=("auto", "optimum", "rounded"),
        help="how words are rounded: optimum, the best whole numbers the controller can hold; rounded, each separately "
             "(default: optimum if the design is an optimum, else rounded)")
    refined: bool = option(
        False, bool, "refine K and TN in the simulated loop (limits, anti-windup, PWM)", flag="--refine")
    setpoint_ramp: float | str | None = option(
        None, float, "rate of the setpoint ramp", unit="°C/min", flag="--setpoint-ramp",
        metavar="auto|none|°C/MIN", or_text=("auto", "none"), above=0.0,
        help="ramp the setpoint at this rate; auto: as fast as the limits on overshoot allow, if they fail without, "
             "with holdback if an open circuit requires it (default: as in the parameters, else none)")
    switch_kind: str | None = option(
        None, str, "what switches the heater", flag="--switch-kind", choices=("ssr", "relay", "contactor"),
        help="what switches the heater; the PWM period is chosen for it, ripple against contact wear")
    boost: str = option(
        "auto", str, "whether the program may give full power itself far from the setpoint", flag="--boost",
        choices=("auto", "none"),
        help="full power far from the setpoint, with the controller disabled; auto: if it makes the design keep its "
             "limits (default: auto; of parameters, as they are)")
    as_is: bool = option(
        False, bool, "keep the plain design, even if other gains, another PWM or TA, a boost or a ramp would pass",
        flag="--no-redesign")

    def __post_init__(self) -> None:
        validate_options(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class SensorSettings:
    """The sensor's range and the module's, which become a `heatertune.plc.Scaling`."""

    range_degC: tuple[float, float] = option(
        (0.0, 100.0), float, "lowest and highest temperature of the sensor", unit="°C", flag="--range",
        pair=("LOW", "HIGH"), instead=("0 100", ""))
    input: str | None = option(
        None, str, "range of the analog module", flag="--input",
        choices=("4-20mA", "thermocouple", "rtd", "rtd-climatic"),
        help="type of the analog module: a 4-20 mA transmitter (broken below 3.6 mA), or a thermocouple or resistance "
             "thermometer whose digits are degrees; for targets whose program reads it (default: a plain range)")

    def __post_init__(self) -> None:
        validate_options(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class FeedForwardSettings:
    """How the PLC sees a measured disturbance, see `heatertune.chain.pipeline`.

    Attributes:
        disturbance_range: the disturbance at the lowest and highest reading of its sensor; None: the levels logged.
        contact: whether its sensor is a contact, open at the low end of that range and closed at the high one.
    """

    disturbance_range: tuple[float, float] | None = option(
        None, float, "the disturbance at the lowest and highest reading of its sensor, in the log's unit",
        flag="--disturbance-range", pair=("LOW", "HIGH"), instead=("the levels logged", ""))
    contact: bool = option(False, bool, "the sensor is a contact, open at LOW and closed at HIGH", flag="--contact")

    def __post_init__(self) -> None:
        validate_options(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class SampleSettings:
    """On which drawn heaters words are proven as well, see `heatertune.proof.monte_carlo.run`.

    Attributes:
        samples: how many; None: none.
        replay: seed of the one sample that is run instead.
    """

    samples: int | None = option(
        None, int, "also prove on N sampled heaters: FAIL if too many of them break a limit, NOT PROVEN if N is too "
                   "small to decide", flag="--samples", metavar="N", least=1.0, most=1e7)
    seed: int = option(
        0, int, "seed of the first sample; the others count up from it", flag="--seed", metavar="SEED",
        least=0.0, instead=("0", ""))
    replay: int | None = option(
        None, int, "run only the sample with this seed, and judge it", flag="--replay", metavar="SEED", least=0.0)
    quantile: float = option(
        0.95, float, "share of all such heaters that must keep every limit", flag="--quantile", metavar="SHARE",
        above=0.0, most=1.0, instead=("0.95", ""))
    mains_pct: float = option(
        10.0, float, "half width of the mains voltage", unit="%", flag="--mains", least=0.0, most=99.0,
        help="spread of the mains voltage, uniform within ± this; the power varies with its square", instead=("10", ""))
    ambient_degC: float = option(
        5.0, float, "spread of the ambient temperature, uniform within ± "
                    "this", unit="°C", flag="--ambient-spread", least=0.0,
        instead=("5", ""))
    disturbance_pct: float = option(
        50.0, float, "half width of each disturbance's size", unit="%", flag="--disturbance-spread", least=0.0,
        most=99.0, help="spread of the size of each disturbance, uniform within ± this", instead=("50", ""))
    jitter_s: float = _time(0.0, "latest delay of a scan", "--jitter", instead=("0", ""))

    @property
    def spread(self) -> dict[str, float]:
        """What is drawn how wide, as `heatertune.proof.monte_carlo.draw.SampleSpread` names it."""
        return {name: getattr(self, name) for name in ("mains_pct", "ambient_degC", "disturbance_pct", "jitter_s")}

    def __post_init__(self) -> None:
        validate_options(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class Conditions:
    """What a proof assumes of plant and user.

    Attributes:
        setpoint_degC: one, or the lowest and the highest of use; None: where the log says that the heater was used, see
            `heatertune.proof.heaters`.
        pwm_period_s: None: TA in parts up to 10 s.
        pwm_resolution_s: None: a tick of the target's clock, see `heatertune.plc.pwm.tick_for`.
        limit_degC: None: the end of the sensor range.
        spec: a preset's name or a specification's file; None: the general one, see `heatertune.proof.specification`.
        profile: file of ramps and soaks, see `heatertune.proof.profile`; None: the specification's, if it has one.
        limit: limits of one's own, NAME=VALUE; several of one name hold together.
        tolerance_degC, step_power_pct: likewise, by their names; None: the specification's.
        switches: open point → its setting, where it is known of this very controller.
        accept: names of findings of the fit that the user accepts.
    """

    setpoint_degC: float | tuple[float, float] | None = option(
        None, float, "setpoint of the proof", unit="°C", flag="--setpoint", label="setpoint", least=_COLDEST_DEGC,
        instead=("", "where the log was used"), several=True,
        help="setpoint, or lowest and highest in use [°C]; do not put it directly before PID")
    pwm_period_s: float | None = _time(
        None, "PWM period", "--pwm-period", least=None, above=0.0, instead=("TA in parts up to 10 s", "from TA"))
    minimum_on_s: float = _time(0.0, "shortest on time", "--minimum-on", needs="pwm_period_s", instead=("0", ""))
    minimum_off_s: float = _time(0.0, "shortest off time", "--minimum-off", needs="pwm_period_s", instead=("0", ""))
    pwm_rule: str | None = option(
        None, str, "block that makes the PWM", flag="--pwm-rule", choices=("pulsegen", "pid-compact", "burst"),
        needs="pwm_period_s", instead=("a plain switch", ""),
        help="block that generates the PWM; pulsegen: --minimum-on is P_B_TM; burst: a power controller")
    pwm_resolution_s: float | None = _time(
        None, "the on time is a multiple of it", "--pwm-resolution", label="PWM resolution", least=None, above=0.0,
        needs="pwm_period_s", help="resolution of the on time, or call interval of the block [s]",
        instead=("the target's tick", "0.1 s on s5-ob251, a half-wave of 50 Hz mains on others"))
    cooling_gain: float | None = option(
        None, float, "power of a cooler as a part of the heater's", flag="--cooling-gain", metavar="X", above=0.0,
        label="cooler's power", instead=("as in the parameters", ""), left_out=True,
        help="a cooler in addition to the heater: its full power relative to the heater's, such as 0.4 (pid-temp)")
    cooling_minimum_on_s: float | None = _time(
        None, "shortest on time of the cooler", "--cooling-minimum-on", needs="cooling_gain", left_out=True)
    cooling_minimum_off_s: float | None = _time(
        None, "shortest off time of the cooler", "--cooling-minimum-off", needs="cooling_gain", left_out=True)
    spec: str | None = option(
        None, str, "limits that the parameters must keep", flag="--spec", metavar="NAME|FILE.toml",
        label="specification", help="the specification: a preset or a file (see: heatertune spec)",
        instead=("general", ""))
    profile: str | None = option(
        None, str, "ramps and soaks of the setpoint", flag="--profile", metavar="FILE.csv", label="profile",
        help="ramps and soaks that your program runs: a table target [degC], ramp [degC/h], soak [min]; the proof "
             "follows it as well", instead=("the specification's, else none", ""))
    limit: tuple[str, ...] = option(
        (), tuple, "a limit of your own", flag="--limit", metavar="NAME=VALUE",
        help="your own limit, such as overshoot=3degC; it replaces that of the specification (see: heatertune spec); "
             "may be repeated, also for one name")
    tolerance_degC: float | None = option(
        None, float, "tolerance around the setpoint", unit="°C", flag="--tolerance",
        label="tolerance around the setpoint", least=0.0,
        help="tolerance around the setpoint, for settling band, offset and oscillation [°C]; as --limit tolerance",
        instead=("the specification's", ""))
    noise_degC: float = option(0.0, float, "sensor noise, standard deviation", unit="°C", flag="--noise", least=0.0)
    step_power_pct: float | None = _step_power("the specification's")
    accept: tuple[str, ...] = option(
        (), tuple, "accept a finding that makes the verdict NOT PROVEN; stated in the certificate; may be repeated",
        flag="--accept", metavar="NAME")
    interlock: str | None = option(
        None, str, "interlock that may open the heater circuit", flag="--interlock", choices=("heater-fan",),
        help="program of the bit processor that may open the heater circuit")
    limit_degC: float | None = option(
        None, float, "temperature at which it does", unit="°C", flag="--limit-temperature",
        help="temperature at which the interlock opens the circuit [°C]", least=_COLDEST_DEGC, needs="interlock",
        instead=("the end of the sensor range", ""))
    fan_stops_s: float | None = _time(
        None, "instant at which its fan fails", "--fan-stops", needs="interlock",
        help="time at which the fan of the interlock fails [s]")
    switches: Mapping[str, str] = option(
        {}, dict, "settings of open points", flag="--assume", metavar="NAME=SETTING",
        help="known setting of an open point; also of a choice that the export follows (see: heatertune targets); may "
             "be repeated")

    def __post_init__(self) -> None:
        validate_options(self)
        if isinstance(self.setpoint_degC, tuple):
            low, high = (*self.setpoint_degC, math.nan)[:2]
            if len(self.setpoint_degC) != 2 or not low < high:
                raise OutOfRange("setpoint_degC", list(self.setpoint_degC), "the lowest first, then the highest")

    def farthest_degC(self, *, cooler: bool) -> float | None:
        """Return the setpoint of use that takes most power, of a cooler the lowest [°C]; None: not stated."""
        return min(self.setpoint_degC) if cooler and isinstance(self.setpoint_degC, tuple) else self.highest_degC

    def nearest_degC(self, *, cooler: bool) -> float | None:
        """Return the setpoint of use that takes least power, of a cooler the highest [°C]; None: no range stated."""
        return max(self.setpoint_degC) if cooler and isinstance(self.setpoint_degC, tuple) else self.lowest_degC

    @property
    def highest_degC(self) -> float | None:
        """The highest setpoint of use; None: nobody told it [°C]."""
        return self.setpoint_degC[1] if isinstance(self.setpoint_degC, tuple) else self.setpoint_degC

    @property
    def lowest_degC(self) -> float | None:
        """The lowest setpoint of use; None: nobody told it [°C]."""
        return self.setpoint_degC[0] if isinstance(self.setpoint_degC, tuple) else None


RECORD_SCHEMA: Final = "heatertune/record/1"


@register_schema(RECORD_SCHEMA)
@dataclass(frozen=True, slots=True, kw_only=True)
class RecordSettings:
    """What the record calls the plant and itself; what is not said is left to be filled in by hand."""

    plant_tag: str | None = option(None, str, "tag of the plant and heater, for the record", flag="--plant-tag",
                                   metavar="TEXT")
    document: str | None = option(None, str, "number of the record", flag="--document", metavar="TEXT")
    revision: str | None = option(None, str, "version of the record", flag="--revision", metavar="TEXT")

    def __post_init__(self) -> None:
        validate_options(self)


@dataclass(frozen=True, slots=True, kw_only=True)
class AsLeftSettings:
    """What is known beside a trace of the settings loop."""

    setpoint_degC: float | None = option(
        None, float, "setpoint of the trace", unit="°C", flag="--setpoint", least=_COLDEST_DEGC,
        instead=("as logged, else that of the proof", ""))
    ambient_degC: float | None = option(
        None, float, "ambient during the trace", unit="°C", flag="--ambient", least=_COLDEST_DEGC,
        instead=("that of the plausible heaters", ""))
    begins_s: float | None = option(
        None, float, "instant of the trace at which the heat-up begins", unit="s", flag="--begins-at",
        instead=("where setpoint, power or temperature show it", ""))
    load_at_s: float | None = option(
        None, float, "instant of the trace at which a load came", unit="s", flag="--load-at",
        help="instant of the trace at which a load came [s]: a door or cold goods; the recovery is measured from there")

    def __post_init__(self) -> None:
        validate_options(self)
