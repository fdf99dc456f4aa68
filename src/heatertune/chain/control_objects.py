"""The loop of a design and the problem behind its optimum, as objects of python-control and CasADi.

control.margin(loop(model, design))
control.step_response(loop(model, design, of="closed"))
control.bode_plot(loop(model, design, continuous=True))
"""

from __future__ import annotations

from dataclasses import replace
from typing import TYPE_CHECKING, Final, Literal

from heatertune.chain.facade import decode
from heatertune.errors import InputError, OutOfRange, UnknownName
from heatertune.model.cooler_mirror import cools
from heatertune.model.model_values import FittedModel, Fopdt, HeaterModel, TwoLag, model_by_hand
from heatertune.model.transfer_functions import LinearSystem, heater_from
from heatertune.options import merge_options, with_options
from heatertune.pid.design_values import PidDesign
from heatertune.pid.sampled_loop import MOST_DELAY, sample_plant
from heatertune.pid.search.feasible import NonlinearProgram, nonlinear_program
from heatertune.pid.tune import stated_problem
from heatertune.pid.tune import tune as tune_model
from heatertune.plc import Words
from heatertune.settings import TuneSettings

if TYPE_CHECKING:
    from typing import Unpack

    from control import TransferFunction

    from heatertune.keywords import TuneOptions

__all__ = ["loop", "problem"]

Part = Literal["open", "closed", "load", "sensitivity"]
_PARTS: Final = ("open", "closed", "load", "sensitivity")


def loop(
    heater: HeaterModel | FittedModel | LinearSystem, design: PidDesign | Words, *, of: Part = "open",
    continuous: bool = False, pade: int | None = None,
) -> TransferFunction:
    """Return the loop of a heater and a design as a transfer function of python-control.

    Sampled, it is exact: held power, and the dead time whatever it is. Continuous, the dead time is a Padé approximant,
    and so is half of TA, the delay of the hold.

    Args:
        heater: of a fit, the working model.
        design: or parameters, which are decoded to the design that they realise.
        of: "open" is the loop L, "closed" L/(1 + L), from setpoint to temperature; "load" G/(1 + L), from power [%] to
            temperature [°C]; "sensitivity" 1/(1 + L).
        continuous: whether a sampled design is returned in s; a design with TA = 0 always is.
        pade: order of the approximant; None: that of `Dynamics.to_tf`.

    Raises:
        UnknownName: no such part of the loop.
        OutOfRange: a dead time of more than 100 samples, of which python-control's polynomials lose all digits.
        InputError, OutOfRange: as `decode` and `heater_from`.
    """
    import control

    if of not in _PARTS:
        raise UnknownName("part of the loop", of, _PARTS)
    model = heater.model if isinstance(heater, FittedModel) else heater
    plant_model = model if isinstance(model, Fopdt | TwoLag) else heater_from(model)
    its = decode(design) if isinstance(design, Words) else design
    ta = its.sample_time_s
    if continuous or ta == 0.0:
        plant = replace(plant_model, dead_time_s=plant_model.dead_time_s + 0.5 * ta).to_tf(pade=pade)
        controller = its.to_tf(continuous=True)
    elif (delay := sample_plant(plant_model, ta).delay) > MOST_DELAY:
        raise OutOfRange("dead_time_s", plant_model.dead_time_s,
                         f"at most {MOST_DELAY} samples, not {delay}, for a sampled loop; or continuous=True")
    else:
        plant, controller = plant_model.to_tf(sample_time_s=ta), its.to_tf()
    if of == "open":
        return plant * controller
    if of == "closed":
        return control.feedback(plant * controller, 1)
    return control.feedback(plant, controller) if of == "load" else control.feedback(1, plant * controller)


@with_options(TuneSettings)
def problem(
    fitted: FittedModel | HeaterModel, settings: TuneSettings | None = None, **changed: Unpack[TuneOptions]
) -> NonlinearProgram:
    """Return the nonlinear program behind the optimum, with the symbols of CasADi, to change and to solve.

    The unknowns are ln K, ln TN and, of a PID, ln TV; it begins at the design that `tune` finds, whose TA it has.

        program = problem(model, ms=1.4)
        program.solve()                                                       # the optimum
        program.solve(limits=[200.0 - program.integral_time_s])               # with TN <= 200 s
        program.solve(cost=program.cost + 0.1 * program.gain_pct_per_degC)    # with another cost

    Args:
        fitted: the heater and its candidates.
        settings: objective and limits; None: the defaults.
        changed: fields of `TuneSettings` that are other than in `settings`.

    Raises:
        InputError: CasADi is not installed; a rule, a P controller, a continuous design or the objective ki, for which
            no program is solved; a cooler; a dead time of too many samples.
        UnknownName, OutOfRange: as `tune`.
    """
    model = fitted if isinstance(fitted, FittedModel) else model_by_hand(fitted)
    asked = merge_options(TuneSettings, settings, changed)
    if cools(model):
        raise InputError("a cooler is tuned as its mirror image: state its gain as positive")
    if asked.method != "optimum":
        raise InputError(f"{asked.method} is a rule, which has no program: leave method out")
    design = tune_model(model, asked)
    return nonlinear_program(stated_problem(model, asked, design.sample_time_s), design)
