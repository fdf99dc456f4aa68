"""What the commands share: groups of options, and what they mean to the stages."""

from __future__ import annotations

import argparse
import math
from typing import TYPE_CHECKING, Any

from heatertune.errors import InputError
from heatertune.units import check

if TYPE_CHECKING:
    from heatertune.chain.words import Choice
    from heatertune.model.values import FittedModel
    from heatertune.pid.values import PidDesign
    from heatertune.plc import Scaling, Words

__all__ = [
    "add_condition_options", "add_log_options", "add_model_options", "add_objective_options",
    "add_proof_options", "add_ramp_option", "add_reading_options", "add_refine_option", "add_step_power_option",
    "add_switch_kind_option",
    "add_switch_option", "add_tuning_options", "add_words_option", "design_and_model", "fitting",
    "interval_by_words", "model_from", "proof_asked", "proving", "reading", "sample_time", "scaling",
    "setpoint_ramp", "switches", "target", "tuning", "words_and_model",
]

_TOLERANCE_DEGC = 1.0
_STEP_POWER_PCT = 10.0
_LEAST_INTERVAL_S = 1e-3  # no controller for heaters is called more often

TARGETS = ("s5-ob251", "s7-200", "s7-200-paper", "s7-200-pid", "s7-300", "fb41", "weg", "on-off")
INTERLOCKS = ("heater-fan",)
PWM_RULES = ("pulsegen", "pid-compact")


def add_reading_options(command: argparse.ArgumentParser) -> None:
    """Add the options that tell how a log file is to be read."""
    group = command.add_argument_group("reading the log")
    group.add_argument("--time-column", metavar="NAME|N", help="column of the time")
    group.add_argument("--temperature-column", metavar="NAME|N", help="column of the temperature")
    group.add_argument("--power-column", metavar="NAME|N", help="column of the heater power; none: there is none")
    group.add_argument("--setpoint-column", metavar="NAME|N", help="column of the setpoint; none: there is none")
    group.add_argument("--date-column", metavar="NAME|N", help="column of the date, beside a time of day")
    group.add_argument("--temperature-unit", choices=("degC", "degF", "K"), help="unit of the temperature")
    group.add_argument("--power-full-scale", type=float, metavar="X", help="reading at full power: 1, 100, 255 …")
    group.add_argument("--time-unit", choices=("s", "ms", "min", "h", "d"), help="unit of the time")
    group.add_argument("--log-interval", type=float, metavar="S", help="interval of a log without time column [s]")
    group.add_argument("--tag", metavar="NAME", help="the temperature's tag, where a file holds rows of several tags")
    group.add_argument("--power-tag", metavar="NAME", help="the power's tag in a long table; none: there is none")
    group.add_argument("--setpoint-tag", metavar="NAME", help="the setpoint's tag in a long table; none: there is none")
    group.add_argument("--tag-column", metavar="NAME|N", help="column of the tags")
    group.add_argument("--quality-column", metavar="NAME|N", help="column of the quality flags; none: do not look")
    group.add_argument("--skip-rows", type=int, default=0, metavar="N", help="pass over the first N lines of the file")
    group.add_argument("--run", type=int, dest="which_run", metavar="N",
                       help="which of several runs in one file (default: the longest)")
    group.add_argument("--skip-empty", action="store_true", help="leave out rows without a temperature (empty, NaN)")
    group.add_argument("--errata", action="store_true", help="apply the known misprints of a built-in table")
    group.add_argument("--until", type=float, metavar="S", help="last instant to use [s]; default: up to a jump")


def add_log_options(command: argparse.ArgumentParser) -> None:
    """Add the options that tell how a log file is to be read and fitted."""
    add_reading_options(command)
    group = command.add_argument_group("fitting the log")
    group.add_argument("--ambient", type=float, nargs="+", metavar="°C", help=(
        "temperature without power [°C]: the value, or the lowest and the highest it may have; after LOG"))
    group.add_argument("--power-before", type=float, metavar="%", help="power before the first reading [%%]")
    group.add_argument("--dead-time-at-most", type=float, metavar="S",
                       help="no dead time is longer, as you know of this heater [s]; the certificate says so")
    group.add_argument("--sensor-delay", type=float, default=0.0, metavar="S",
                       help="by which the sensor is known to lag behind [s] (default: 0)")


def add_model_options(command: argparse.ArgumentParser) -> None:
    """Add the options of a model given by hand."""
    group = command.add_argument_group("a model by hand, instead of a model file")
    group.add_argument("--gain", type=float, metavar="°C/%", help="rise per percent of power [°C/%%]")
    group.add_argument("--time-constant", type=float, metavar="S", help="time constant [s]")
    group.add_argument("--second-time-constant", type=float, metavar="S", help="second time constant, if any [s]")
    group.add_argument("--dead-time", type=float, metavar="S", help="dead time [s]")
    group.add_argument("--ambient", type=float, metavar="°C", help="temperature without power [°C]")


def add_tuning_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `tune`."""
    group = command.add_argument_group("tuning")
    group.add_argument("--structure", choices=("p", "pi", "pid"), default="pi", help="parts that act (default: pi)")
    group.add_argument("--method", default="optimum", metavar="NAME",
                       help="optimum (default), or a rule: simc, lambda, imc, amigo, ziegler-nichols, "
                            "ziegler-nichols-ultimate, cohen-coon, chr-{setpoint,load}-{0,20}, tyreus-luyben, "
                            "lopez-{iae,ise,itae}, rovira-{iae,itae}, usort-{load,setpoint}-{2.0,1.8,1.6,1.4}")
    group.add_argument("--closed-loop", type=float, metavar="S",
                       help="closed-loop time constant: τc of simc, λ of lambda and imc [s] (default: the rule's own)")
    add_objective_options(group)
    group.add_argument("--ms", type=float, default=1.6, help="largest sensitivity Ms of the optimum (default: 1.6)")
    group.add_argument("--robust", choices=("none", "p95", "worst"), default="none",
                       help="keep the limits of the optimum on heaters drawn from the fit's intervals too: 95 %% of "
                            "them, or all (default: none; what is lost on them is told)")
    group.add_argument("--sample-time", default="auto", metavar="S",
                       help="sampling interval TA [s]; auto: TRdom/10 (default); words: near that, as suits the "
                            "words; 0: continuous")


def add_objective_options(group: Any) -> None:
    """Add what the optimum minimises, and the limits beside Ms."""
    group.add_argument("--objective", choices=("load", "setpoint", "itae", "ki", "iae", "ise"), default="load",
                       help="of the optimum: IAE after a load step (default; also iae) or a setpoint step, ITAE or ISE "
                       "after a load step, largest integral gain")
    group.add_argument("--weight", type=float, metavar="W",
                       help="with the objective load: share of the setpoint IAE in the cost, 0 to 1")
    group.add_argument("--mt", type=float, default=math.inf, help="largest Mt of the optimum (default: no limit)")
    group.add_argument("--mks", type=float, default=math.inf, metavar="%/°C",
                       help="largest noise gain Mks from reading to power [%%/°C] (default: no limit)")


def add_switch_kind_option(command: argparse.ArgumentParser) -> None:
    """Add --switch-kind."""
    command.add_argument("--switch-kind", choices=("relay", "ssr"),
                         help="what switches the heater: the PWM period is proposed, ripple against wear of contacts")


def add_words_option(command: argparse.ArgumentParser) -> None:
    """Add --words."""
    command.add_argument("--words", choices=("auto", "optimum", "rounded"), default="auto",
                         help="the best whole numbers the controller can hold, or each rounded on its own (default: "
                              "optimum for a design that is an optimum itself, else rounded)")


def add_refine_option(command: argparse.ArgumentParser) -> None:
    """Add --refine."""
    command.add_argument("--refine", action="store_true",
                         help="change K and TN where the loop of the proof (limits, anti-windup, PWM) gains by it")


def add_ramp_option(command: argparse.ArgumentParser) -> None:
    """Add --setpoint-ramp."""
    command.add_argument("--setpoint-ramp", metavar="auto|none|°C/MIN",
                         help="lead the setpoint to its end at so many °C/min; auto: as fast as the limit on overshoot "
                              "allows, where that alone fails (default: as the words have it, else none)")


def setpoint_ramp(settings: argparse.Namespace) -> float | str | None:
    """Return the setpoint ramp: [°C/min], auto, none, or None where nothing was said.

    Raises:
        InputError: it is none of these.
    """
    asked: str | None = settings.setpoint_ramp
    if asked in (None, "auto", "none"):
        return asked
    try:
        return float(asked)
    except ValueError as problem:
        raise InputError(f"--setpoint-ramp is {asked!r}; expected °C/min, auto or none") from problem


def add_proof_options(command: argparse.ArgumentParser, *, target: str | None = None) -> None:
    """Add the target, which must be given unless it has a default, and the conditions of the proof."""
    group = command.add_argument_group("target")
    default = "" if target is None else f" (default: {target})"
    group.add_argument("--target", required=target is None, default=target, metavar="NAME",
                       help=f"the controller: {', '.join(TARGETS)}{default}")
    group.add_argument("--faithful", action="store_true",
                       help="the program as its source prints it, faults included (s7-200)")
    add_switch_option(group, "setting of a point that the manual leaves open, where you know it of your controller")
    add_condition_options(command)


def add_step_power_option(group: Any) -> None:
    """Add --step-power."""
    group.add_argument("--step-power", type=float, default=_STEP_POWER_PCT, metavar="%",
                       help="most power that one step of the reading, or its noise, may move [%%] (default: 10)")


def add_switch_option(group: Any, text: str) -> None:
    """Add --switch."""
    group.add_argument("--switch", action="append", default=[], metavar="NAME=SETTING",
                       help=f"{text} (see: heatertune targets); may be repeated")


def switches(settings: argparse.Namespace) -> dict[str, str]:
    """Return the settings given with --switch.

    Raises:
        InputError: one without a setting.
    """
    pairs = [each.partition("=") for each in settings.switch]
    for name, equals, _ in pairs:
        if not equals:
            raise InputError(f"--switch {name!r} has no setting; expected NAME=SETTING")
    return {name: setting for name, _, setting in pairs}


def add_condition_options(command: argparse.ArgumentParser) -> None:
    """Add the conditions of the proof."""
    group = command.add_argument_group("conditions of the proof")
    group.add_argument("--range", nargs=2, type=float, metavar=("LOW", "HIGH"), default=(0.0, 100.0),
                       help="sensor range at the lowest and highest reading [°C] (default: 0 100)")
    group.add_argument("--setpoint", type=float, metavar="°C", help="setpoint of the proof [°C]")
    group.add_argument("--pwm-period", type=float, metavar="S", help="PWM period [s] (default: TA in parts up to 10 s)")
    group.add_argument("--minimum-on", type=float, default=0.0, metavar="S", help="shortest on time [s] (default: 0)")
    group.add_argument("--minimum-off", type=float, default=0.0, metavar="S", help="shortest off time [s] (default: 0)")
    group.add_argument("--pwm-rule", choices=PWM_RULES,
                       help="block that makes the PWM; pulsegen: --minimum-on is P_B_TM (default: a plain switch)")
    group.add_argument("--pwm-resolution", type=float, metavar="S",
                       help="the on time is a multiple of it; a block's call interval [s] (default: 0.01)")
    group.add_argument("--tolerance", type=float, default=_TOLERANCE_DEGC, metavar="°C",
                       help="how far from the setpoint is still right: band, offset and swing [°C] (default: 1)")
    group.add_argument("--noise", type=float, default=0.0, metavar="°C", help="sensor noise, standard deviation [°C]")
    add_step_power_option(group)
    group.add_argument("--accept", action="append", default=[], metavar="NAME",
                       help="accept a finding of the fit that leaves words not proven; the certificate says so; may "
                            "be repeated")
    group.add_argument("--interlock", choices=INTERLOCKS,
                       help="program of the bit processor that may open the heater's circuit")
    group.add_argument("--limit-temperature", type=float, metavar="°C",
                       help="where the interlock does so [°C] (default: the end of the sensor range)")
    group.add_argument("--fan-stops", type=float, metavar="S", help="instant at which the interlock's fan fails [s]")


def reading(settings: argparse.Namespace) -> dict[str, Any]:
    """Return the options of `read_log`."""
    names = ("time_column", "temperature_column", "power_column", "setpoint_column", "date_column", "temperature_unit",
             "power_full_scale", "time_unit", "tag", "power_tag", "setpoint_tag", "tag_column", "quality_column")
    found = _given(settings, *names)
    set_apart = ("skip_rows", "errata", "skip_empty")
    found |= {name: getattr(settings, name) for name in set_apart if getattr(settings, name)}
    others = {"sample_time_s": settings.log_interval, "run": settings.which_run}
    return found | {name: value for name, value in others.items() if value is not None}


def fitting(settings: argparse.Namespace) -> dict[str, Any]:
    """Return the options of `chain.fit`.

    Raises:
        InputError: more than two ambient temperatures.
    """
    ambient = settings.ambient
    if ambient is not None and len(ambient) > 2:
        raise InputError(f"--ambient has {len(ambient)} values; expected one, or LOW HIGH")
    known = ambient if ambient is None else ambient[0] if len(ambient) == 1 else tuple(ambient)
    return {"ambient_degC": known, "power_before_pct": settings.power_before, "until_s": settings.until,
            "dead_time_at_most_s": settings.dead_time_at_most, "sensor_delay_s": settings.sensor_delay}


def tuning(settings: argparse.Namespace) -> dict[str, Any]:
    """Return the options of `chain.tune`; errors as `sample_time`."""
    return {"sample_time_s": sample_time(settings), "closed_loop_s": settings.closed_loop,
            "step_power_pct": settings.step_power} | {
        name: getattr(settings, name)
        for name in ("structure", "method", "objective", "ms", "mt", "mks", "weight", "robust")
    }


def sample_time(settings: argparse.Namespace) -> float | None:
    """Return the sampling interval [s], None for auto.

    Raises:
        InputError: it is neither a number nor auto nor words.
        OutOfRange: it is negative, or below a millisecond.
    """
    asked = settings.sample_time
    if asked in ("auto", "words"):
        return None
    try:
        seconds = float(asked)
    except ValueError as problem:
        raise InputError(f"--sample-time is {asked!r}; expected seconds, auto or words") from problem
    check("sample_time_s", seconds, least=_LEAST_INTERVAL_S if seconds > 0.0 else 0.0)
    return seconds


def interval_by_words(settings: argparse.Namespace) -> bool:
    """Return whether TA is to be found by the words."""
    return bool(settings.sample_time == "words")


def proving(settings: argparse.Namespace) -> dict[str, Any]:
    """Return the options of `chain.prove`."""
    from heatertune.proof.pwm import switched_by  # noqa: PLC0415 - the help must not wait for numpy

    found: dict[str, Any] = {
        "setpoint_degC": settings.setpoint, "noise_degC": settings.noise, "tolerance_degC": settings.tolerance,
        "known": switches(settings) if "switch" in settings else None,
        "interlock": settings.interlock, "limit_degC": settings.limit_temperature, "fan_stops_s": settings.fan_stops,
        "step_power_pct": settings.step_power, "accept": tuple(settings.accept),
    }
    if settings.interlock is None and (settings.limit_temperature is not None or settings.fan_stops is not None):
        raise InputError("--limit-temperature and --fan-stops need --interlock: they are told to it")
    switched = {"minimum_on_s": settings.minimum_on, "minimum_off_s": settings.minimum_off}
    resolution = settings.pwm_resolution
    if settings.pwm_period is None:
        if any(switched.values()) or settings.pwm_rule is not None or resolution is not None:
            raise InputError("--minimum-on, --minimum-off, --pwm-rule and --pwm-resolution need --pwm-period")
        return found
    if resolution is not None:
        switched["resolution_s"] = resolution
    return found | {"actuator": switched_by(settings.pwm_rule, pwm_period_s=settings.pwm_period, **switched)}


def target(settings: argparse.Namespace) -> str:
    """Return the target; with --faithful the same as its source prints it.

    Raises:
        UnknownName: --faithful for a target that has no such version.
    """
    from heatertune.errors import UnknownName  # noqa: PLC0415
    from heatertune.plc import FAITHFUL  # noqa: PLC0415

    if not settings.faithful:
        return str(settings.target)
    if settings.target not in FAITHFUL:
        raise UnknownName("target with --faithful", settings.target, FAITHFUL)
    return FAITHFUL[settings.target]


def scaling(settings: argparse.Namespace) -> Scaling:
    """Return the sensor range."""
    from heatertune.plc import Scaling  # noqa: PLC0415

    return Scaling(low_degC=settings.range[0], high_degC=settings.range[1])


def words_and_model(settings: argparse.Namespace) -> tuple[Words, Choice | None, FittedModel]:
    """Return the words of a design or words file, how they were found (None: given), and the model to prove them on.

    Raises:
        InputError: the file holds no model and none is given by hand; words of another target.
        NotRepresentable, OutOfRange: the words do not fit.
    """
    from heatertune.chain.words import choose_words  # noqa: PLC0415
    from heatertune.chain.words_file import read_words  # noqa: PLC0415

    words = read_words(settings.pid, target(settings))
    if words is not None:
        return words, None, model_from(settings, None)
    design, model = design_and_model(settings)
    choice = choose_words(design, target(settings), model, scaling=scaling(settings), way=settings.words)
    return choice.words, choice, model


def design_and_model(settings: argparse.Namespace) -> tuple[PidDesign, FittedModel]:
    """Return the design of a file, and the model to prove it on: the one given by hand, else the file's.

    Raises:
        InputError: the file holds no model and none is given by hand.
    """
    from heatertune.pid.document import read_design  # noqa: PLC0415

    design, model = read_design(settings.pid)
    return design, model if model is not None and not _by_hand(settings) else model_from(settings, None)


def proof_asked(settings: argparse.Namespace) -> bool:
    """Return whether an option asks for a proof of its own: a heater by hand, another condition, a ramp."""
    given = _given(settings, "setpoint", "pwm_period", "pwm_rule", "pwm_resolution", "interlock", "limit_temperature",
                   "fan_stops", "setpoint_ramp")
    other = settings.noise or settings.minimum_on or settings.minimum_off or settings.switch or settings.refine
    changed = settings.tolerance != _TOLERANCE_DEGC or settings.step_power != _STEP_POWER_PCT
    return bool(given or other) or changed or _by_hand(settings)


def _by_hand(settings: argparse.Namespace) -> bool:
    """Return whether a model is given by hand."""
    return any(getattr(settings, name) is not None for name in ("gain", "time_constant", "dead_time"))


def _given(settings: argparse.Namespace, *names: str) -> dict[str, Any]:
    return {name: getattr(settings, name) for name in names if getattr(settings, name) is not None}


def model_from(settings: argparse.Namespace, path: str | None) -> FittedModel:
    """Return the model of a file, or the one given by hand.

    Raises:
        InputError: both or neither are given, or a number of the hand-given model is missing.
    """
    from heatertune.model.by_hand import model_by_hand  # noqa: PLC0415
    from heatertune.model.document import read_model  # noqa: PLC0415 - the help must not wait for numpy
    from heatertune.model.values import Fopdt, TwoLag  # noqa: PLC0415

    names = ("gain", "time_constant", "dead_time")
    numbers = _given(settings, *names)
    if path is not None and numbers:
        raise InputError("give a model file or --gain, --time-constant, --dead-time, not both")
    if path is not None:
        return read_model(path)
    missing = [f"--{name.replace('_', '-')}" for name in names if name not in numbers]
    if missing:
        raise InputError(f"no model: give a model file, or {', '.join(missing)} as well")
    plant = {
        "gain_degC_per_pct": settings.gain, "time_constant_s": settings.time_constant,
        "dead_time_s": settings.dead_time, "ambient_degC": settings.ambient,
    }
    if settings.second_time_constant is None:
        return model_by_hand(Fopdt(**plant))
    return model_by_hand(TwoLag(**plant, second_time_constant_s=settings.second_time_constant))
