"""From a heater's temperature log to PID parameters for your PLC, proven before they reach the plant.

    log  →  model  →  pid  →  plc  →  proof  →  report

The functions here are the whole chain, stage by stage, beside the values that travel along it:

    import heatertune as ht

    model = ht.fit("heater.csv")
    words = ht.encode(ht.tune(model, target="s5-ob251"), "s5-ob251", model)
    print(ht.prove(words, model).summary())
"""

from importlib import import_module
from typing import TYPE_CHECKING

from heatertune.lazy import lazy_attributes
from heatertune.show import run_by, shown_by, stored_by

__version__ = "0.25.0"

__all__ = [
    "Actuator", "Conditions", "DesignRequest", "FitSettings", "FittedModel", "Fopdt", "HeatertuneError", "InputError",
    "Interval", "Load", "Log", "LoopLimits", "NotRepresentable", "PidDesign", "Proof", "ReadSettings", "ReadingNoise",
    "Scaling", "Scenario", "TemperatureStep", "TuneSettings", "TwoLag", "Words", "alternatives", "choose_words",
    "compare", "controller", "decode", "design", "draw_heaters", "encode", "export", "fit", "fit_known",
    "fit_together", "fleet", "front", "iae_load", "load", "loop", "margins", "model_by_hand", "plan", "problem",
    "prove", "read_log", "read_zones", "replay_document", "sample_document", "simulate", "study", "tune", "validate",
    "virtual_plc", "write_report",
]

if TYPE_CHECKING:
    from heatertune.batch.fleets import fleet
    from heatertune.batch.studies import study
    from heatertune.chain import (
        compare,
        design,
        encode,
        export,
        fit,
        fit_known,
        fit_together,
        plan,
        prove,
        read_log,
        tune,
        validate,
        write_report,
    )
    from heatertune.chain.documents import load
    from heatertune.chain.facade import controller, decode, iae_load, margins, simulate
    from heatertune.chain.second_opinion import loop, problem
    from heatertune.errors import HeatertuneError, InputError, NotRepresentable
    from heatertune.live.serve import virtual_plc
    from heatertune.log.log_values import Log
    from heatertune.model.experiment.fisher import ReadingNoise
    from heatertune.model.model_values import FittedModel, Fopdt, TwoLag, model_by_hand
    from heatertune.model.statistics import Interval
    from heatertune.pid.alternatives import alternatives, front
    from heatertune.pid.design_values import PidDesign
    from heatertune.pid.search.robust import draw_heaters
    from heatertune.plc import Scaling, Words
    from heatertune.plc.word_selection import choose_words
    from heatertune.proof import Actuator, Load, LoopLimits, Proof, Scenario, TemperatureStep
    from heatertune.proof.monte_carlo.run import replay_document, sample_document
    from heatertune.proof.redesign import DesignRequest
    from heatertune.settings import Conditions, FitSettings, ReadSettings, TuneSettings
    from heatertune.zones import read_zones


# `heatertune --help` needs none of them
__getattr__, __dir__ = lazy_attributes(__name__, {
    "batch.fleets": ("fleet",),
    "batch.studies": ("study",),
    "chain": (
        "compare", "design", "encode", "export", "fit", "fit_known", "fit_together", "plan", "prove", "read_log",
        "tune", "validate", "write_report"),
    "chain.second_opinion": ("loop", "problem"),
    "chain.documents": ("load",),
    "chain.facade": ("controller", "decode", "iae_load", "margins", "simulate"),
    "errors": ("HeatertuneError", "InputError", "NotRepresentable"),
    "live.serve": ("virtual_plc",),
    "log.log_values": ("Log",),
    "model.model_values": ("model_by_hand", "FittedModel", "Fopdt", "TwoLag"),
    "model.experiment.fisher": ("ReadingNoise",),
    "model.statistics": ("Interval",),
    "pid.alternatives": ("alternatives", "front"),
    "pid.search.robust": ("draw_heaters",),
    "pid.design_values": ("PidDesign",),
    "plc": ("Scaling", "Words"),
    "plc.word_selection": ("choose_words",),
    "proof": ("Actuator", "LoopLimits", "Load", "Proof", "Scenario", "TemperatureStep"),
    "proof.redesign": ("DesignRequest",),
    "proof.monte_carlo.run": ("replay_document", "sample_document"),
    "settings": ("Conditions", "FitSettings", "ReadSettings", "TuneSettings"),
    "zones": ("read_zones",),
})


run_by(lambda words, switches: import_module("heatertune.plc.controller").controller_for(words.target).instantiate(
    words, switches))
shown_by(lambda: import_module("heatertune.report.notebook"))
stored_by(lambda: import_module("heatertune.chain.documents"))
