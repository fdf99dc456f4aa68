"""The options of the functions by name, for editors and mypy; written by `python -m tests.keywords --update`."""

from __future__ import annotations

from collections.abc import Mapping
from typing import TYPE_CHECKING, Literal, TypedDict

if TYPE_CHECKING:
    from heatertune.settings import SampleSettings

__all__ = [
    "AsLeftOptions",
    "ConditionOptions",
    "DesignOptions",
    "FitOptions",
    "LogFitOptions",
    "ReadOptions",
    "SampleOptions",
    "SensorOptions",
    "TargetTuneOptions",
    "TuneOptions",
    "ValidateOptions",
    "WordOptions",
]


class ReadOptions(TypedDict, total=False):
    """Keywords of `ReadSettings`."""

    #: column of the time
    time_column: str | int | None
    #: column of the temperature
    temperature_column: str | int | None
    #: column of the heater power; none: no such column
    power_column: str | int | None
    #: file of the power, if it has one of its own
    power_log: str | None
    #: column of the setpoint; none: no such column
    setpoint_column: str | int | None
    #: column of a measured load (a flow, a fan, a door) whose effect is fitted; none: no such column
    disturbance_column: str | int | None
    #: column of a cooler's power; none: no such column
    cooling_column: str | int | None
    #: column of the room's temperature; none: no such column
    ambient_column: str | int | None
    #: column of the date, if the time column contains only times of day
    date_column: str | int | None
    #: unit of the temperature
    temperature_unit: Literal["degC", "degF", "K", "0.1degC", "0.01degC", "0.1degF"] | None
    #: factor from a reading to its unit, 0.1 for tenths
    temperature_scale: float | None
    #: reading at full power: 1, 100, 255 …
    power_full_scale: float | None
    #: readings without power and at full power: 4 20, 1 5, -100 100 …
    power_levels: tuple[float, float] | None
    #: cell of a switched power that means on, other words mean off; a row with a blank or a word for no value
    #: is left out, unless the column has no other word for off
    power_on: str | None
    #: unit of the time
    time_unit: Literal["s", "ms", "us", "ns", "min", "h", "d", "mm:ss", "hh:mm"] | None
    #: interval of a log without time column [s]
    sample_time_s: float | None
    #: columns whose numbers have decimal commas that also separate the cells: their numbers (1 = first) or
    #: names, with commas between them; none: no column
    decimal_comma: str | None
    #: tag of the temperature, if the file has rows of several tags
    tag: str | None
    #: tag of the power in such a file; none: no such tag
    power_tag: str | None
    #: tag of the setpoint in such a file; none: no such tag
    setpoint_tag: str | None
    #: column of the tags
    tag_column: str | int | None
    #: column of the quality flags; none: ignore them
    quality_column: str | int | None
    #: skip the first N lines of the file
    skip_rows: int
    #: which of several runs in one file (default: the longest)
    run: int | None
    #: leave out rows without a temperature (empty, NaN)
    skip_empty: bool
    #: correct the known misprints of a built-in table
    errata: bool


class FitOptions(TypedDict, total=False):
    """Keywords of `FitSettings`."""

    #: ambient temperature, if it is known [°C]
    ambient_degC: float | tuple[float, float] | None
    #: power before the log's first reading [%]
    power_before_pct: float | None
    #: first instant of the log to use [s]
    from_s: float | None
    #: last instant of the log to use [s]
    until_s: float | None
    #: longest dead time, if you know one [s]
    dead_time_at_most_s: float | None
    #: known delay of the sensor [s] (default: 0)
    sensor_delay_s: float
    #: PWM period of the heater while it was logged [s] (default: the log's)
    log_pwm_period_s: float | None
    #: thresholds of the two-level control that made a log without power [°C]
    thermostat: tuple[float, ...] | None
    #: largest power in a log that does not contain the power [%]
    largest_power_pct: float | None
    #: the power cools: more power, lower temperature
    cooler: bool
    #: no other heater heats the slow mass of a heater of two time scales
    alone: bool


class ValidateOptions(TypedDict, total=False):
    """Keywords of `ValidateSettings`."""

    #: ambient during this log [°C] (default: the model's own)
    ambient_degC: float | None
    #: power before the first reading [%]
    power_before_pct: float | None
    #: last instant of the log to use [s]
    until_s: float | None
    #: fit that every model must reach [%] (default: 80)
    least_fit_pct: float


class TuneOptions(TypedDict, total=False):
    """Keywords of `TuneSettings`."""

    #: parts of the controller (default: pi)
    structure: Literal["p", "P", "pi", "PI", "pid", "PID"]
    #: optimum or a rule (default: optimum)
    method: str
    #: closed-loop time constant of a rule [s] (default: the rule's own)
    closed_loop_s: float | None
    #: what the optimum minimises (default: load)
    objective: Literal["load", "setpoint", "itae", "ITAE", "ki", "KI", "iae", "IAE", "ise", "ISE"]
    #: share of the setpoint IAE
    weight: float | None
    #: largest Mt of the optimum (default: no limit)
    mt: float
    #: largest Mks of the optimum [%/°C] (default: no limit)
    mks: float
    #: largest Ms of the optimum (default: 1.6)
    ms: float
    #: on which drawn heaters the limits of the optimum hold too (default: none)
    robust: Literal["none", "p95", "worst"]
    #: sampling interval TA [s]
    sample_time_s: float | Literal["auto"] | None
    #: largest change of the power by one step of the reading, or by its noise [%] (default: 10)
    step_power_pct: float | None


class SensorOptions(TypedDict, total=False):
    """Keywords of `SensorSettings`."""

    #: lowest and highest temperature of the sensor [°C] (default: 0 100)
    range_degC: tuple[float, float]
    #: range of the analog module
    input: Literal["4-20mA", "thermocouple", "rtd", "RTD", "rtd-climatic"] | None


class WordOptions(TypedDict, total=False):
    """Keywords of `WordSettings`."""

    #: how the words are found (default: auto)
    words_by: Literal["auto", "optimum", "rounded"]
    #: refine K and TN in the simulated loop (limits, anti-windup, PWM)
    refined: bool
    #: rate of the setpoint ramp [°C/min]
    setpoint_ramp: float | Literal["auto", "none"] | None
    #: what switches the heater
    switch_kind: Literal["ssr", "SSR", "relay", "contactor"] | None
    #: whether the program may give full power itself far from the setpoint (default: auto)
    boost: Literal["auto", "none"]
    #: keep the plain design, even if other gains, another PWM or TA, a boost or a ramp would pass
    as_is: bool


class SampleOptions(TypedDict, total=False):
    """Keywords of `SampleSettings`."""

    #: also prove on N sampled heaters: FAIL if too many of them break a limit, NOT PROVEN if N is too small to
    #: decide
    samples: int | None
    #: seed of the first sample; the others count up from it (default: 0)
    seed: int
    #: run only the sample with this seed, and judge it
    replay: int | None
    #: share of all such heaters that must keep every limit (default: 0.95)
    quantile: float
    #: half width of the mains voltage [%] (default: 10)
    mains_pct: float
    #: spread of the ambient temperature, uniform within ± this [°C] (default: 5)
    ambient_degC: float
    #: half width of each disturbance's size [%] (default: 50)
    disturbance_pct: float
    #: latest delay of a scan [s] (default: 0)
    jitter_s: float


class ConditionOptions(TypedDict, total=False):
    """Keywords of `Conditions`."""

    #: setpoint of the proof [°C]
    setpoint_degC: float | tuple[float, float] | None
    #: PWM period [s] (default: TA in parts up to 10 s)
    pwm_period_s: float | None
    #: shortest on time [s] (default: 0)
    minimum_on_s: float
    #: shortest off time [s] (default: 0)
    minimum_off_s: float
    #: block that makes the PWM (default: a plain switch)
    pwm_rule: Literal["pulsegen", "pid-compact", "burst"] | None
    #: the on time is a multiple of it [s] (default: the target's tick)
    pwm_resolution_s: float | None
    #: power of a cooler as a part of the heater's (default: as in the parameters)
    cooling_gain: float | None
    #: shortest on time of the cooler [s]
    cooling_minimum_on_s: float | None
    #: shortest off time of the cooler [s]
    cooling_minimum_off_s: float | None
    #: limits that the parameters must keep (default: general)
    spec: str | None
    #: ramps and soaks of the setpoint (default: the specification's, else none)
    profile: str | None
    #: a limit of your own
    limit: tuple[str, ...] | list[str] | str
    #: tolerance around the setpoint [°C] (default: the specification's)
    tolerance_degC: float | None
    #: sensor noise, standard deviation [°C]
    noise_degC: float
    #: largest change of the power by one step of the reading, or by its noise [%] (default: the
    #: specification's)
    step_power_pct: float | None
    #: accept a finding that makes the verdict NOT PROVEN; stated in the certificate; may be repeated
    accept: tuple[str, ...] | list[str] | str
    #: interlock that may open the heater circuit
    interlock: Literal["heater-fan"] | None
    #: temperature at which it does [°C] (default: the end of the sensor range)
    limit_degC: float | None
    #: instant at which its fan fails [s]
    fan_stops_s: float | None
    #: settings of open points
    switches: Mapping[str, str]


class AsLeftOptions(TypedDict, total=False):
    """Keywords of `AsLeftSettings`."""

    #: setpoint of the trace [°C] (default: as logged, else that of the proof)
    setpoint_degC: float | None
    #: ambient during the trace [°C] (default: that of the plausible heaters)
    ambient_degC: float | None
    #: instant of the trace at which the heat-up begins [s] (default: where setpoint, power or temperature show
    #: it)
    begins_s: float | None
    #: instant of the trace at which a load came [s]
    load_at_s: float | None


class LogFitOptions(ReadOptions, FitOptions, total=False):
    """ReadOptions and FitOptions."""


class TargetTuneOptions(TuneOptions, SensorOptions, total=False):
    """TuneOptions and SensorOptions."""


class DesignOptions(TuneOptions, SensorOptions, WordOptions, ConditionOptions, total=False):
    """TuneOptions and SensorOptions and WordOptions and ConditionOptions."""

    #: the controller
    target: str
    #: whether TA is the one whose parameters round best
    interval_by_words: bool
    #: on which drawn heaters the design has to pass as well
    sample_settings: SampleSettings | None
