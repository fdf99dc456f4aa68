"""One function per stage; each passes the stage the inputs that come from other stages."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from pathlib import Path
from typing import IO, TYPE_CHECKING, Any, Literal, Protocol, cast, runtime_checkable

from heatertune import cache
from heatertune.errors import ExportRefused, InputError
from heatertune.log import read_log
from heatertune.log.log_values import Log
from heatertune.log.read import log_of
from heatertune.model import model_document
from heatertune.model.circumstances import pool_candidates
from heatertune.model.model_values import FittedModel
from heatertune.options import Keywords, checked_arguments, merge_options, split_options, with_options
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Scaling, Words, controller_for
from heatertune.plc.design import encode as round_words
from heatertune.plc.design import stated_scaling
from heatertune.plc.targets import target_by_name
from heatertune.plc.word_selection import choose_words
from heatertune.processors import ProgressCallback, log_progress
from heatertune.proof import Proof
from heatertune.proof.known_controller_check import closed_again, controllers
from heatertune.proof.words_file import certificate
from heatertune.settings import FitSettings, ReadSettings, SensorSettings

if TYPE_CHECKING:
    from typing import Unpack

    import numpy.typing as npt
    from pandas import DataFrame

    from heatertune.keywords import FitOptions, LogFitOptions, SensorOptions

__all__ = ["encode", "export", "fit", "fit_known", "fit_together"]


@runtime_checkable
class SeveralZones(Protocol):
    """A log of several heaters that exchange heat, which knows how to identify them."""

    def fit_zones(self, **settings: Any) -> Any:
        """Return the thermal network of the zones."""


@with_options(FitSettings, ReadSettings)
def fit(
    data: Log | SeveralZones | str | Path | IO[Any] | DataFrame | tuple[npt.ArrayLike, ...],
    settings: FitSettings | None = None, *,
    read: ReadSettings | None = None, thorough: bool = False, companions: bool = True,
    progress: ProgressCallback = log_progress, **changed: Unpack[LogFitOptions],
) -> FittedModel:
    """Identify the heater of a log; without power, the fit simulates the paper's control laws.

    Args:
        data: a log, or what `heatertune.log.read.log_of` makes one of: a path or built-in name, an open file, a
            table
            of pandas, arrays (time_s, temperature_degC, power_pct), all of shape (n,); of a log of several zones (see
            `heatertune.zones.read_zones`) the result is their thermal network, `heatertune.zones.FittedNetwork`.
        settings: additional knowledge about the heater and the log; None: nothing.
        read: how to read a file; None: detect everything.
        thorough: fit every controller hypothesis completely, even if it is far behind.
        companions: whether the candidates of other built-in logs of the same heater are added, as `design` does.
        progress: called with a short message when a stage begins.
        changed: fields of `FitSettings` that differ from `settings`, and of `ReadSettings` that differ from `read`.

    Raises:
        InputError, OutOfRange: as `heatertune.model.fit.fit` and `log_of`; options of a file for data that are none.
    """
    if isinstance(data, SeveralZones):
        return cast("FittedModel", data.fit_zones(**changed))  # for the checker: fit_network tells the type
    fitting, reading = split_options(
        changed, FitSettings, ReadSettings, also=("settings", "read", "thorough", "companions", "progress"))
    options, log = merge_options(FitSettings, settings, fitting), _log(data, read, reading)
    fitted = _fit_one(log, options, progress, thorough=thorough)
    if not companions:
        return fitted
    others = [_fit_one(read_log(name, errata=True), FitSettings(), progress) for name in log.same_heater]
    return pool_candidates(fitted, others)


@with_options(FitSettings)
def fit_together(
    logs: Sequence[Log], settings: FitSettings | None = None, *, progress: ProgressCallback = log_progress,
    **changed: Unpack[FitOptions],
) -> FittedModel:
    """Identify the one heater behind several logs, all with power or all without; arguments as in `fit`.

    Raises:
        InputError, OutOfRange: as `heatertune.model.fit.fit_together`.
    """
    from heatertune.model.fit import fit_together as fit_logs

    if isinstance(logs, Log | str) or not logs:
        raise InputError("no logs: expected a list of one log or more")
    options = merge_options(FitSettings, settings, changed)
    laws = () if any(log.power_pct is not None for log in logs) else _laws()
    return _cached_fit(
        "fit-together", {"logs": [_columns(log) for log in logs], **asdict(options)},
        lambda: fit_logs(logs, options, laws=laws, progress=progress), progress,
    )


@with_options(FitSettings)
def fit_known(
    log: Log, words: Words, settings: FitSettings | None = None, *, setpoint_degC: float | None = None,
    stated: Mapping[str, str] | None = None, progress: ProgressCallback = log_progress,
    **changed: Unpack[FitOptions],
) -> FittedModel:
    """Identify the heater of a log without power but with a known controller.

    Args:
        log: without power; its first reading is the controller's first.
        words: parameters of the controller.
        settings: as in `fit`; if no power before the first reading is given, it was 0.
        setpoint_degC: its setpoint [°C]; None: as logged.
        stated: open point → known setting of this controller.
        progress: called with a short message when a stage begins.
        changed: as in `fit`.

    Raises:
        InputError, OutOfRange: as `heatertune.model.fit.fit_known`; words with a setpoint ramp.
        UnknownName: no such open point or setting.
    """
    if words.ramp is not None:
        raise InputError("parameters with a setpoint ramp: a log contains the requested setpoint, not the ramped one")
    from heatertune.model.fit import fit_known as fit_log_known

    tried = controllers(words, stated)
    options = merge_options(FitSettings, settings, changed)
    inputs = _columns(log) | asdict(options) | {
        "setpoint_degC": setpoint_degC, "target": words.target, "words": dict(words.values),
        "sample_time_s": words.sample_time_s, "range": repr(words.scaling),
        "switches": [dict(controller.switches) for controller in tried],
    }

    def run() -> FittedModel:
        fitted = fit_log_known(log, tried, options, setpoint_degC=setpoint_degC, progress=progress)
        return replace(fitted, notes=(*fitted.notes, closed_again(log, fitted, tried, setpoint_degC)))

    return _cached_fit("fit-known", inputs, run, progress)


def _log(data: Any, read: ReadSettings | None, options: Keywords) -> Log:
    """Return the log, read from a file as the options say.

    Raises:
        InputError: as `log_of`; options of a file for data that are none.
    """
    if read is None and not options:
        return log_of(data)
    if isinstance(data, Log | tuple):
        raise InputError(f"{', '.join(options) or 'read'}: for a file; this log is read already")
    return read_log(data, merge_options(ReadSettings, read, options))


def _fit_one(log: Log, settings: FitSettings, progress: ProgressCallback, *, thorough: bool = False) -> FittedModel:
    def run() -> FittedModel:
        from heatertune.model.fit import fit as fit_log

        laws = _laws() if log.power_pct is None else ()
        return fit_log(log, settings, laws=laws, thorough=thorough, progress=progress)

    return _cached_fit("fit", _columns(log) | asdict(settings) | {"thorough": thorough}, run, progress)


def _columns(log: Log) -> dict[str, Any]:
    signals = {f"{role}_{part}": getattr(signal, part) for role, signal in log.signals.items()
               for part in ("time_s", "values", "late_s")}
    summary = None if log.taken is None else (
        log.taken.line, log.taken.repaired_share, sorted(log.taken.stated), dict(log.taken.assumed),
        log.taken.moving_heaters)
    return {"name": log.name, "rests_at_degC": log.rests_at_degC, "output_limit_pct": log.output_limit_pct,
            "taken": summary} | signals


def _cached_fit(stage: str, inputs: Mapping[str, Any], run: Callable[[], FittedModel],
          progress: ProgressCallback) -> FittedModel:
    """Return the cached result for the same inputs, or that of `run`."""
    return cache.load_or_compute(stage, inputs, lambda: model_document.to_document(run()), model_document.from_document,
                        progress=progress)


def _laws() -> Sequence[Any]:
    from heatertune.plc.s7_200_paper.step import LAWS

    return LAWS


@with_options(SensorSettings)
def encode(
    design: PidDesign, target: str, fitted: FittedModel | None = None, *, scaling: Scaling | None = None,
    words_by: Literal["auto", "optimum", "rounded"] = "auto", **changed: Unpack[SensorOptions],
) -> Words:
    """Encode a design as the parameters of a target.

    Args:
        design: result of the tuning.
        target: the controller.
        fitted: the heater and its candidates, for the choice that `design` makes; None: each parameter is
            rounded on its own.
        scaling: sensor range; None: as `range_degC` and `input` say.
        words_by: how the words are found, see `heatertune.plc.word_selection.choose_words`.
        changed: fields of `SensorSettings`.

    Raises:
        UnknownName: no such target.
        InputError: both `scaling` and fields of `SensorSettings`, or a model-based choice without a model.
        NotRepresentable: a parameter does not fit; the error names the nearest change that would.
    """
    target = target_by_name(target)
    scaling = stated_scaling(target, scaling, changed, also=("target", "fitted", "scaling", "words_by"))
    if fitted is None:
        if words_by == "optimum":
            raise InputError("words_by = 'optimum' needs the heater: encode(design, target, model)")
        return round_words(design, target, scaling=scaling)
    return choose_words(design, target, fitted, scaling=scaling, way=words_by).words


@checked_arguments
def export(words: Words, proof: Proof, *, force: bool = False) -> dict[str, str | bytes]:
    """Return the export files of proven words, name → content.

    Raises:
        ExportRefused: the verdict is not PASS and `force` was not given, or the proof is of other words or a first
            look.
    """
    if proof.words != words:
        raise ExportRefused("the proof was made for other words; prove these first")
    if not proof.open_points:
        raise ExportRefused("the proof is a first look under default settings; prove what the manual leaves open, too")
    return dict(controller_for(words.target).export(words, certificate(proof.to_document(), force=force)))
