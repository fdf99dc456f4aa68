"""A design for a target: tuned for its timer and its input, and rounded to its words."""

from __future__ import annotations

from collections.abc import Callable, Iterable
from dataclasses import asdict, replace
from functools import lru_cache, partial
from typing import TYPE_CHECKING, Any, Final

from heatertune import cache
from heatertune.errors import InputError
from heatertune.model import model_document
from heatertune.model.model_values import FittedModel, Fopdt, HeaterModel, TwoLag, model_by_hand
from heatertune.model.transfer_functions import LinearSystem, heater_from
from heatertune.options import Keywords, merge_options, split_options, with_options
from heatertune.pid import design_document as pid_document
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Scaling, Words, controller_for
from heatertune.plc.targets import target_by_name
from heatertune.processors import ProgressCallback, log_progress
from heatertune.settings import SensorSettings, TuneSettings, refuse_unused_limits

if TYPE_CHECKING:
    from typing import Unpack

    from heatertune.keywords import TargetTuneOptions

__all__ = ["encode", "fitted_model_of", "loop_fit", "stated_scaling", "tune"]

#: of a model's document, what is told and no design depends on
_TOLD: Final = ("residuals", "notes", "hypotheses", "whiteness", "input_crosscorrelation", "held_out", "halves", "logs")
_KEPT: Final = 2  # heaters: each move of a slider asks for the same one


@with_options(TuneSettings, SensorSettings)
def tune(
    fitted: FittedModel | HeaterModel | LinearSystem, settings: TuneSettings | None = None, *,
    target: str | None = None,
    scaling: Scaling | None = None, progress: ProgressCallback = log_progress, **changed: Unpack[TargetTuneOptions],
) -> PidDesign:
    """Find K, TN, TV and TA; with a target, TA is what its timer can do, and a reading as fine as its input's.

    With a target the loop that is tuned is the one that a proof judges: its input module's delay is part of it.

    Args:
        fitted: the heater and its candidates; or a single heater, also as a transfer function of python-control, see
            `Fopdt.from_tf`.
        settings: what is asked for; None: the defaults.
        target: the controller; None: any.
        scaling: sensor range; None: as `range_degC` and `input` say.
        progress: called with a few words as each step begins.
        changed: fields of `TuneSettings` that are other than in `settings`, and of `SensorSettings`.

    Raises:
        UnknownName, OutOfRange, InputError: as `heatertune.pid.tune.tune`; both `scaling` and a sensor's fields.
    """
    from heatertune.pid.tune import tune as tune_model

    own_names = ("settings", "target", "scaling", "progress")
    tuning, sensing = split_options(changed, TuneSettings, SensorSettings, also=own_names)
    options, fitted = merge_options(TuneSettings, settings, tuning), fitted_model_of(fitted)
    refuse_unused_limits(merge_options(TuneSettings, None, tuning))  # of the user, not of a search
    target = None if target is None else target_by_name(target)
    scaling = stated_scaling(target, scaling, sensing)
    args: dict[str, Any] = {}
    delay: list[str] = []
    most_gain: Callable[[PidDesign], float] | None = None
    if target is not None:
        its, sensor = controller_for(target), scaling or Scaling()
        fitted, seconds = loop_fit(fitted, target, sensor), its.delayed_s(sensor)
        if seconds > 0.0:
            delay = [f"Tuned with {seconds:g} s more dead time, the delay of {target}'s input and output."]
        args = {"timer": its.timer, "derivative_filter": its.derivative_filter,
                "resolution_degC": sensor.span_degC / its.sensor(sensor).counts}
        if its.most_gain is not None:
            most_gain = partial(its.most_gain, sensor)
    inputs = {"model": _essence(fitted), "settings": asdict(options), "held": {name: repr(args[name]) for name in args},
              "most_gain": target if most_gain else None}

    def run() -> dict[str, Any]:
        return pid_document.to_document(tune_model(fitted, options, most_gain=most_gain, progress=progress, **args))

    design = cache.load_or_compute("tune", inputs, run, pid_document.from_document, progress=progress)
    return replace(design, notes=(*design.notes, *delay))


def fitted_model_of(heater: FittedModel | HeaterModel | LinearSystem) -> FittedModel:
    """Return a fit, or that of a single heater; raise InputError for what is none."""
    if isinstance(heater, FittedModel):
        return heater
    return model_by_hand(heater if isinstance(heater, Fopdt | TwoLag) else heater_from(heater))


def stated_scaling(
    target: str | None, scaling: Scaling | None, sensor: Keywords, *, also: Iterable[str] = ()
) -> Scaling | None:
    """Return the sensor range as its module gives it; None where nothing is said.

    Args:
        target: the controller, which a module's range needs.
        scaling: the range as a value.
        sensor: fields of `SensorSettings` instead.
        also: other keywords of the function that was called.

    Raises:
        UnknownOption: no such field.
        InputError: both, or a module's range without a target; as `heatertune.plc.inputs.sensor_scaling`.
    """
    settings = merge_options(SensorSettings, None, sensor, also=also)
    if not sensor:
        return scaling
    if scaling is not None:
        raise InputError(f"give scaling or {' and '.join(sensor)}, not both")
    if settings.input is None:
        low, high = settings.range_degC
        return Scaling(low_degC=low, high_degC=high)
    if target is None:
        raise InputError("input needs a target: the ranges are its module's")
    return controller_for(target).scaled(settings.input, settings.range_degC)


@lru_cache(_KEPT)
def _essence(fitted: FittedModel) -> dict[str, Any]:
    """Return the inputs of a design: the working model and the candidates."""
    document = model_document.to_document(fitted)
    return {key: document[key] for key in document if key not in _TOLD}


def loop_fit(fitted: FittedModel, target: str, scaling: Scaling | None = None) -> FittedModel:
    """Return the heaters as the loop of a target has them: with the delay of its input module and its output.

    Args:
        fitted: the heater and its candidates.
        target: the controller.
        scaling: sensor range; None: 0…100 °C.

    Raises:
        UnknownName: no such target.
    """
    return _delayed(fitted, controller_for(target).delayed_s(scaling or Scaling()))


@lru_cache(_KEPT)
def _delayed(fitted: FittedModel, delay_s: float) -> FittedModel:
    return fitted.with_delay(delay_s)


def encode(design: PidDesign, target: str, *, scaling: Scaling | None = None) -> Words:
    """Round a design to the words of a target.

    Raises:
        UnknownName: no such target.
        NotRepresentable: a word does not fit; the error tells the nearest change that would.
    """
    return controller_for(target).encode(design, scaling or Scaling())
