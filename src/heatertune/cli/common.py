"""What the commands share: groups of options, and what they mean to the stages."""

from __future__ import annotations

import argparse
from collections.abc import Sequence
from typing import TYPE_CHECKING, Any

from heatertune import options, plc
from heatertune.documents import peek_schema
from heatertune.errors import InputError, UnknownName
from heatertune.plc.targets import COOLING, FAITHFUL, NAMES
from heatertune.settings import (
    Conditions,
    FitSettings,
    ReadSettings,
    SampleSettings,
    SensorSettings,
    TuneSettings,
    WordSettings,
)
from heatertune.units import check

if TYPE_CHECKING:
    from heatertune.model.values import FittedModel
    from heatertune.pid.design_provenance import DesignProvenance
    from heatertune.pid.values import PidDesign
    from heatertune.plc.dump_reader import Machine
    from heatertune.proof.redesign import DesignRequest

__all__ = [
    "add_condition_options",
    "add_log_options",
    "add_model_options",
    "add_proof_options",
    "add_reading_options",
    "add_tuning_options",
    "add_word_options",
    "by_hand",
    "conditions",
    "design_and_model",
    "design_request",
    "interval_by_words",
    "model_from",
    "proof_asked",
    "reading",
    "sample_time",
    "scaling",
    "target",
    "words_of_machine",
]


def add_reading_options(command: argparse.ArgumentParser) -> None:
    """Add the options that tell how a log file is to be read."""
    group = command.add_argument_group("reading the log")
    options.add(group, ReadSettings)
    options.add(group, FitSettings, "until_s")


def add_log_options(command: argparse.ArgumentParser) -> None:
    """Add the options that tell how a log file is to be read and fitted."""
    add_reading_options(command)
    options.add(command.add_argument_group("fitting the log"), FitSettings, but=("until_s",))


def add_model_options(command: argparse.ArgumentParser) -> None:
    """Add the options of a model given by hand."""
    group = command.add_argument_group("a model by its numbers, instead of a model file")
    group.add_argument("--gain", type=float, metavar="°C/%",
                       help="temperature rise per percent of power [°C/%%]; negative for a cooler")
    group.add_argument("--time-constant", type=float, metavar="S", help="time constant [s]")
    group.add_argument("--second-time-constant", type=float, metavar="S", help="second time constant, if any [s]")
    group.add_argument("--dead-time", type=float, metavar="S", help="dead time [s]")
    group.add_argument("--ambient", type=float, metavar="°C", help="ambient temperature, reached without power [°C]")


def add_tuning_options(command: argparse.ArgumentParser) -> None:
    """Add the options of `tune`."""
    options.add(command.add_argument_group("tuning"), TuneSettings, but=("step_power_pct",))


def add_proof_options(command: argparse.ArgumentParser, *, target: str | None = None, needed: bool = True) -> None:
    """Add the target, which must be given where it is needed and has no default, and the conditions of the proof."""
    group = command.add_argument_group("target")
    default = "" if target is None else f" (default: {target})"
    group.add_argument("--target", required=needed and target is None, default=target, metavar="NAME",
                       type=options.one_of(NAMES),
                       help=f"the controller (see: heatertune targets): {', '.join(NAMES)}{default}")
    group.add_argument("--faithful", action="store_true",
                       help="the program exactly as its source prints it, with its faults (s7-200)")
    options.add(group, Conditions, "switches", default=argparse.SUPPRESS)
    add_condition_options(command)


def add_condition_options(command: argparse.ArgumentParser, *sensor: str) -> None:
    """Add the conditions of the proof; what is not said is not there, so that another source of it can be asked.

    Args:
        command: to add them to.
        sensor: names of the sensor's options; none: all of them.
    """
    group = command.add_argument_group("conditions of the proof")
    options.add(group, SensorSettings, *sensor, default=argparse.SUPPRESS)
    options.add(group, Conditions, but=("switches",), default=argparse.SUPPRESS)


def add_word_options(command: argparse.ArgumentParser, *names: str, but: Sequence[str] = ()) -> None:
    """Add the options of the words, or those of the names; what is not said is not there."""
    options.add(command, WordSettings, *names, but=but, default=argparse.SUPPRESS)


def conditions(settings: argparse.Namespace) -> Conditions:
    """Return the conditions of the proof; errors as `heatertune.options.of`."""
    return options.of(Conditions, settings)


def reading(settings: argparse.Namespace) -> ReadSettings:
    """Return how a log file is to be read; errors as `heatertune.options.of`."""
    return options.of(ReadSettings, settings)


def sample_time(settings: argparse.Namespace) -> float | None:
    """Return the sampling interval [s], None for auto; errors as `heatertune.options.of`."""
    interval: float | None = options.options_of(TuneSettings)["sample_time_s"].read(settings.sample_time)
    return interval


def interval_by_words(settings: argparse.Namespace) -> bool:
    """Return whether TA is to be found by the words."""
    return bool(settings.sample_time == "words")


def target(settings: argparse.Namespace) -> str:
    """Return the target; with --faithful the same as its source prints it, with --cooling-gain the one with a cooler.

    Raises:
        UnknownName: --faithful for a target that has no such version.
    """
    if not settings.faithful:
        cools = options.provided_options(Conditions, settings).get("cooling_gain") is not None
        return COOLING.get(settings.target, settings.target) if cools else str(settings.target)
    if settings.target not in FAITHFUL:
        raise UnknownName("target with --faithful", settings.target, FAITHFUL)
    return FAITHFUL[settings.target]


def design_request(settings: argparse.Namespace) -> DesignRequest:
    """Return what a design is asked for; errors as `heatertune.options.of`."""
    from heatertune.proof.design_request import DesignRequest  # noqa: PLC0415 - the help must not wait for it

    by = options.of(WordSettings, settings)
    return DesignRequest(
        target=target(settings), scaling=scaling(settings), tune_settings=options.of(TuneSettings, settings),
        conditions=conditions(settings), interval_by_words=interval_by_words(settings), words_by=by.words_by,
        refined=by.refined, setpoint_ramp=by.setpoint_ramp, boost=by.boost, switch_kind=by.switch_kind,
        as_is=by.as_is, sample_settings=options.of(SampleSettings, settings))


def scaling(settings: argparse.Namespace) -> plc.Scaling:
    """Return the sensor range as its module gives it.

    Raises:
        InputError: a module's range without a target; else as `heatertune.plc.inputs.sensor_scaling`.
    """
    sensor = options.of(SensorSettings, settings)
    if sensor.input is None:
        low, high = sensor.range_degC
        return plc.Scaling(low_degC=low, high_degC=high)
    if settings.target is None:
        raise InputError("--input needs --target: the ranges are its module's")
    return plc.controller_for(target(settings)).scaled(sensor.input, sensor.range_degC)


def design_and_model(settings: argparse.Namespace) -> tuple[PidDesign, FittedModel, DesignProvenance | None]:
    """Return the design of a file, the model to prove it on, given by hand or else the file's, and its words' recipe.

    Raises:
        InputError: the file holds no model and none is given by hand.
    """
    from heatertune.pid.document import read_design  # noqa: PLC0415

    design, model, recipe = read_design(settings.pid)
    return design, model if model is not None and not by_hand(settings) else model_from(settings, None), recipe


def words_of_machine(settings: argparse.Namespace, path: str) -> Machine:
    """Return what a dump or text of a controller holds; errors as `heatertune.plc.dump_reader.read_machine`.

    Raises:
        InputError: the file cannot be read.
    """
    from heatertune.plc.dump_reader import content_of, read_machine  # noqa: PLC0415 - the help must not wait for it

    if settings.called_every is not None:
        check("--called-every", settings.called_every, above=0.0)
    return read_machine(plc.controller_for(target(settings)), content_of(path), sample_time_s=settings.called_every,
                        scaling=scaling(settings), source=path, known=conditions(settings).switches)


def proof_asked(settings: argparse.Namespace) -> bool:
    """Return whether an option asks for a proof of its own: a heater by hand, another condition, a ramp, no boost."""
    heard = {"accept"}  # an export hears these without another proof
    other = options.provided_options(Conditions, settings).keys() - heard
    by = options.of(WordSettings, settings)
    return bool(other) or by.setpoint_ramp is not None or by.boost == "none" or by.refined or by_hand(settings)


def by_hand(settings: argparse.Namespace) -> bool:
    """Return whether a model is given by hand."""
    return any(getattr(settings, name, None) is not None for name in ("gain", "time_constant", "dead_time"))


def _given(settings: argparse.Namespace, *names: str) -> dict[str, Any]:
    return {name: getattr(settings, name) for name in names if getattr(settings, name) is not None}


def _model_of_design(path: str) -> FittedModel | None:
    """Return the model that a pid.json holds; None where the file is none."""
    from heatertune.pid.document import SCHEMA, read_design  # noqa: PLC0415 - the help must not wait for it

    if peek_schema(path) != SCHEMA:
        return None
    model = read_design(path)[1]
    if model is None:
        raise InputError(f"{path} is a design without its model: give the model.json, or --gain, --time-constant and "
                         "--dead-time")
    return model


def model_from(settings: argparse.Namespace, path: str | None) -> FittedModel:
    """Return the model of a file (model.json, or the one in a pid.json), or the one given by hand.

    Raises:
        InputError: both or neither are given, or a number of the hand-given model is missing.
    """
    from heatertune.model.document import read_model  # noqa: PLC0415 - the help must not wait for numpy
    from heatertune.model.manual_model import model_by_hand  # noqa: PLC0415
    from heatertune.model.values import Fopdt, TwoLag  # noqa: PLC0415

    names = ("gain", "time_constant", "dead_time")
    numbers = _given(settings, *names)
    if path is not None and numbers:
        raise InputError("name a model file or --gain, --time-constant, --dead-time, not both")
    if path is not None:
        return _model_of_design(path) or read_model(path)
    missing = [f"--{name.replace('_', '-')}" for name in names if name not in numbers]
    if missing:
        raise InputError(f"no model: name a model file, or add {', '.join(missing)}")
    plant = {
        "gain_degC_per_pct": settings.gain, "time_constant_s": settings.time_constant,
        "dead_time_s": settings.dead_time, "ambient_degC": settings.ambient,
    }
    if settings.second_time_constant is None:
        return model_by_hand(Fopdt(**plant))
    return model_by_hand(TwoLag(**plant, second_time_constant_s=settings.second_time_constant))
