"""How a value is displayed: its card in a notebook, its picture in axes, its lines of text."""

from __future__ import annotations

from functools import singledispatch
from typing import TYPE_CHECKING

import numpy as np

from heatertune.codec import plain
from heatertune.log.log_values import Log
from heatertune.model import model_document
from heatertune.model.model_values import FittedModel
from heatertune.pid import design_document as pid_document
from heatertune.pid.design_values import PidDesign
from heatertune.plc import Words, controller_for
from heatertune.plc.inputs import describe_range
from heatertune.plc.keyed_entry import typed_table, typed_words
from heatertune.proof import Proof, Trace
from heatertune.proof.proof_document import ProofView
from heatertune.proof.verdict import verdict_line
from heatertune.report.cards import card, draw_figure, panels
from heatertune.report.layout import table
from heatertune.report.report_text import criteria_table, design_lines, figure, model_lines
from heatertune.report.verdict_summary import model_brief, verify_brief

if TYPE_CHECKING:
    from matplotlib.axes import Axes

__all__ = ["card", "plot", "summary", "whole_summary"]


def plot(value: object, ax: Axes | None = None) -> Axes:
    """Draw a value into axes or a new pyplot figure, and return the axes; see `panels` for exceptions."""
    from matplotlib import pyplot as plt

    if ax is None:
        return draw_figure(value, plt.figure())[1][0]
    panels(value)[0].paint(ax)
    return ax


def summary(value: object, *, verbose: bool = False) -> str:
    """Return a value of the chain as lines of text; raise TypeError for any other.

    Args:
        value: of the chain.
        verbose: all there is to say, not one screen with the point first.
    """
    if not verbose and isinstance(value, FittedModel):
        brief = model_brief(plain(model_document.to_document(value)))
        return f"{value!r}\n\n{brief}".replace("--verbose", "summary(verbose=True)")
    if not verbose and isinstance(value, Proof | ProofView):
        return verify_brief(plain(value.to_dict()))
    return whole_summary(value)


@singledispatch
def whole_summary(value: object) -> str:
    """Return all there is to say of a value of the chain; raise TypeError for any other."""
    raise TypeError(f"no summary of a {type(value).__name__}")


@whole_summary.register
def _log(value: Log) -> str:
    def span(column: np.ndarray | None, unit: str) -> str:
        return "not logged" if column is None else f"{figure(np.min(column))} … {figure(np.max(column))} {unit}"

    rows = [("readings", f"{len(value.time_s)} in {figure(np.ptp(value.time_s))} s"),
            ("temperature", span(value.temperature_degC, "°C")), ("heater power", span(value.power_pct, "%")),
            ("setpoint", span(value.setpoint_degC, "°C"))]
    notes = (*(() if value.taken is None else (value.taken.line,)), *value.repairs, *value.warnings)
    return "\n".join([f"log {value.name}", table(rows), *(f"- {note}" for note in notes)])


@whole_summary.register
def _model(value: FittedModel) -> str:
    return model_lines(plain(model_document.to_document(value)))


@whole_summary.register
def _design(value: PidDesign) -> str:
    return design_lines(plain(pid_document.to_document(value)))


@whole_summary.register
def _words(value: Words) -> str:
    controller = controller_for(value.target)
    heads, values, rows = typed_table(typed_words(value))
    faults = () if controller.faults is None else controller.faults(value)
    rate = f"called every {figure(value.sample_time_s)} s; sensor {describe_range(value.scaling)}"
    shown = table([heads, *rows], right=values)
    return "\n".join([controller.title, shown, rate, *(f"! {fault}" for fault in faults)])


@whole_summary.register
def _proof(value: Proof | ProofView) -> str:
    document = plain(value.to_dict())
    return f"{verdict_line(document)}\n{criteria_table(document)}"


@whole_summary.register
def _trace(value: Trace) -> str:
    low, high = np.min(value.temperature_degC), np.max(value.temperature_degC)
    who = "ideal controller" if value.words is None else value.words.target
    return (f"closed loop of {who} at {figure(value.setpoint_degC)} °C for {figure(float(value.time_s[-1]))} s: "
            f"{figure(low)} … {figure(high)} °C, {len(value.edge_time_s)} switchings of the heater")
