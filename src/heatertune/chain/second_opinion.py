"""A design with python-control and CasADi: their margins, step response and optimum, and their objects for a study.

python-control works with polynomials in z, heatertune with the exact heater from sample to sample and with a grid of
frequencies. IPOPT minimises the same cost under the same limits from another start.

    control.margin(loop(model, design))
    control.step_response(loop(model, design, of="closed"))
    control.bode_plot(loop(model, design, continuous=True))
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from typing import TYPE_CHECKING, Final, Literal

import numpy as np

from heatertune.chain.facade import decode
from heatertune.codec import OrInfinite, register_schema
from heatertune.errors import HeatertuneError, InputError, OutOfRange, UnknownName
from heatertune.model.findings import Finding
from heatertune.model.model_values import FittedModel, Fopdt, HeaterModel, TwoLag
from heatertune.model.reduction import cools
from heatertune.model.transfer_functions import LinearSystem, heater_from
from heatertune.options import merge_options, with_options
from heatertune.pid.design_values import PidDesign
from heatertune.pid.sampled_loop import (
    MOST_DELAY,
    control_margins,
    horizon,
    loop_transfer_function,
    margins,
    respond,
    sample_plant,
)
from heatertune.pid.search.feasible import NonlinearProgram, Problem, keeps, nonlinear_program, on_the_limit
from heatertune.pid.tune import stated_problem
from heatertune.pid.tune import tune as tune_model
from heatertune.plc import Words
from heatertune.plc.design import fitted_model_of
from heatertune.settings import TuneSettings
from heatertune.units import written

if TYPE_CHECKING:
    from typing import Unpack

    from control import TransferFunction

    from heatertune.keywords import TuneOptions

__all__ = ["SECOND_OPINION_SCHEMA", "OpinionRow", "SecondOpinion", "disagreement", "loop", "problem", "second_opinion"]


SECOND_OPINION_SCHEMA: Final = "heatertune/second-opinion/1"

_LIBRARY: Final = "python-control"
#: relative difference allowed of Ms, Mt and gain margin, which each side finds on its own grid of frequencies
_OF_PEAKS: Final = 0.01
_OF_PHASE_DEG: Final = 1.0
#: of the setpoint's step: python-control's polynomials lose digits with each sample of dead time
_OF_STEP: Final = 1e-3
#: by how much IPOPT's cost may be lower: its start is another one, and it rounds the corner of |e|
_OF_COST: Final = 0.05
#: IPOPT begins with this share of the gain, which is within every limit that a higher one keeps
_BEGIN: Final = 0.8
_MOST_SAMPLES: Final = 2000


@dataclass(frozen=True, slots=True, kw_only=True)
class OpinionRow:
    """One figure by both.

    Attributes:
        quantity: what it is, with its unit.
        library: which calculated the other one.
        value: by heatertune.
        library_value: by the library.
        tolerance: allowed difference, in the unit of the figure.
        agrees: whether they are that near, or both infinite.
    """

    quantity: str
    library: str
    value: OrInfinite
    library_value: OrInfinite
    tolerance: OrInfinite
    agrees: bool


@register_schema(SECOND_OPINION_SCHEMA)
@dataclass(frozen=True, slots=True, kw_only=True)
class SecondOpinion:
    """The figures side by side.

    Attributes:
        digest: of the proof; empty: none yet.
        heater: label of the plausible heater with the largest Ms, on which the loop is compared.
        rows: the figures.
        notes: what was not compared and why, and what IPOPT found, one sentence each.
    """

    digest: str = ""
    heater: str = ""
    rows: tuple[OpinionRow, ...] = ()
    notes: tuple[str, ...] = ()


def second_opinion(
    words_design: PidDesign | None, heaters: Sequence[tuple[str, HeaterModel]], ideal: PidDesign,
    problem: Problem | None, *, is_optimum: bool,
) -> SecondOpinion:
    """Return the libraries' results for a design and for its rounding.

    Args:
        words_design: design that the words realise; None: they are no PID.
        heaters: label and heater that the proof ran, as the controller sees it.
        ideal: design before rounding.
        problem: behind its optimum; None: there is none, as of a cooler.
        is_optimum: whether the design is that optimum, and not a rule's or one that the search has changed.
    """
    if words_design is None or words_design.sample_time_s == 0.0:
        loop = SecondOpinion(notes=(f"Not compared with {_LIBRARY}: the controller is no sampled PID.",))
    else:
        loop = _of_loop(words_design, heaters)
    if problem is None:
        return loop
    try:
        rows, notes = _of_optimum(ideal, problem, is_optimum=is_optimum)
    except HeatertuneError as reason:
        rows, notes = [], [f"Not compared with CasADi: {reason}."]
    return replace(loop, rows=(*loop.rows, *rows), notes=(*loop.notes, *notes))


def disagreement(opinion: SecondOpinion) -> tuple[Finding, ...]:
    """Return the finding that leaves parameters unproven where two programs disagree; nothing where they agree."""
    return tuple(
        Finding(name="second-opinion", message=(
            f"{row.library} calculates {row.quantity} = {row.library_value:.5g}, heatertune {row.value:.5g}; they may "
            f"differ by {written(row.tolerance)}."))
        for row in opinion.rows if not row.agrees)[:1]


def _of_loop(design: PidDesign, heaters: Sequence[tuple[str, HeaterModel]]) -> SecondOpinion:
    label, heater = max(heaters, key=lambda labelled: margins(labelled[1], design).ms)
    if (delay := sample_plant(heater, design.sample_time_s).delay) > MOST_DELAY:
        return SecondOpinion(heater=label, notes=(
            f"Not compared with {_LIBRARY}: the dead time spans {delay} samples, too many for its polynomials.",))
    own, other = margins(heater, design), control_margins(heater, design)
    assert other is not None
    rows = [_row("Ms", own.ms, other.ms, _OF_PEAKS * own.ms), _row("Mt", own.mt, other.mt, _OF_PEAKS * own.mt),
            _row("phase margin [°]", own.phase_margin_deg, other.phase_margin_deg, _OF_PHASE_DEG)]
    if math.isfinite(other.gain_margin):  # it does not look at half the sampling frequency
        rows.insert(2, _row("gain margin", own.gain_margin, other.gain_margin, _OF_PEAKS * own.gain_margin))
    if other.stable:
        rows.append(_step(heater, design))
    return SecondOpinion(heater=label, rows=tuple(rows))


def _step(heater: HeaterModel, design: PidDesign) -> OpinionRow:
    """Return the highest value after a unit step of the setpoint, by both."""
    import control

    samples = min(horizon(heater, design), _MOST_SAMPLES)
    closed = control.feedback(loop_transfer_function(heater, design), 1)
    times = np.arange(samples) * design.sample_time_s
    response = control.step_response(closed, T=times).outputs
    own = respond(heater, design, samples, setpoint_degC=1.0)
    return _row("highest value of the setpoint's step", float(np.max(own)), float(np.max(response)), _OF_STEP)


def _of_optimum(ideal: PidDesign, problem: Problem, *, is_optimum: bool) -> tuple[list[OpinionRow], list[str]]:
    """Return the cost of the design and of IPOPT's optimum, both by CasADi, and a sentence about the latter.

    A design that is the optimum may not cost more; one that the search has changed, so that its proof passes, may.
    """
    program = nonlinear_program(problem, replace(ideal, gain_pct_per_degC=_BEGIN * ideal.gain_pct_per_degC))
    best = on_the_limit(problem, program.solve())
    if not keeps(problem, best):  # its intervals were for the response of a design that is slower
        nearer = replace(best, gain_pct_per_degC=_BEGIN * best.gain_pct_per_degC)
        best = on_the_limit(problem, nonlinear_program(problem, nearer).solve())
    cost, best_cost = (program.cost_at(np.log(list(_unknowns(design)))) for design in (ideal, best))
    if not keeps(problem, best):
        return [], ["Not compared with CasADi: IPOPT ended at gains outside of the limits."]
    text = (f"IPOPT's optimum within the same limits, from {_BEGIN:g} times the gain: K {best.gain_pct_per_degC:.4g} "
            f"%/°C, TN {best.integral_time_s:.4g} s, TV {best.derivative_time_s:.4g} s.")
    if not is_optimum:
        return [], [f"{text} Its cost ({problem.objective}) is {best_cost / cost:.3g} times that of the design, which "
                    "is no optimum: a rule made it, or the search changed it so that its proof passes."]
    row = OpinionRow(quantity=f"cost of the optimum ({problem.objective})", library="CasADi (IPOPT)", value=cost,
                     library_value=best_cost, tolerance=_OF_COST * cost, agrees=best_cost >= (1.0 - _OF_COST) * cost)
    return [row], [text]


def _unknowns(design: PidDesign) -> Iterator[float]:
    yield from (design.gain_pct_per_degC, design.integral_time_s)
    if design.structure == "pid":
        yield design.derivative_time_s


def _row(quantity: str, value: float, library_value: float, tolerance: float) -> OpinionRow:
    agrees = value == library_value or abs(value - library_value) <= tolerance
    return OpinionRow(quantity=quantity, library=_LIBRARY, value=value, library_value=library_value,
                      tolerance=tolerance, agrees=agrees)


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
    if not isinstance(design, PidDesign | Words):
        raise InputError(f"no design: {type(design).__name__}; expected what tune() finds, or parameters of encode()")
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
    fitted: FittedModel | HeaterModel | LinearSystem, settings: TuneSettings | None = None,
    **changed: Unpack[TuneOptions],
) -> NonlinearProgram:
    """Return the nonlinear program behind the optimum, with the symbols of CasADi, to change and to solve.

    The unknowns are ln K, ln TN and, of a PID, ln TV; it begins at the design that `tune` finds, whose TA it has.

        program = problem(model, ms=1.4)
        program.solve()                                                       # the optimum
        program.solve(limits=[program.integral_time_s <= 200.0])
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
    model = fitted_model_of(fitted)
    options = merge_options(TuneSettings, settings, changed)
    if cools(model):
        raise InputError("a cooler is tuned as its mirror image: state its gain as positive")
    if options.method != "optimum":
        raise InputError(f"{options.method} is a rule, which has no program: leave method out")
    design = tune_model(model, options)
    return nonlinear_program(stated_problem(model, options, design.sample_time_s), design)
