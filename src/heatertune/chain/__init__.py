"""The whole chain as functions; it hands later stages to earlier ones where a loop goes back.

    log = read_log("table4")
    model = fit(log)
    design = tune(model, target="s5-ob251")
    words = encode(design, target="s5-ob251")
    proof = prove(words, model)
    write_report(log, model, design, proof, "out/")

There is no algorithm here: each function asks the stage that knows. `design` does it all.
"""

from importlib import import_module
from typing import TYPE_CHECKING, Any

__all__ = [
    "Asked", "closed", "compare", "design", "encode", "export", "fit", "fit_known", "fit_together", "plan", "prove",
    "prove_ramped", "read_log", "tune", "validate", "write_report",
]

if TYPE_CHECKING:
    from heatertune.chain.closing import Asked, closed
    from heatertune.chain.experiment import plan
    from heatertune.chain.ramp import prove_ramped
    from heatertune.chain.stages import encode, export, fit, fit_known, fit_together, tune
    from heatertune.chain.targets import compare
    from heatertune.chain.validation import validate
    from heatertune.chain.whole import design, write_report
    from heatertune.log import read_log
    from heatertune.proof import prove

_STAGES = "stages"
_HOMES = {
    "Asked": "closing", "closed": "closing",
    "compare": "targets", "design": "whole", "plan": "experiment", "prove_ramped": "ramp",
    "validate": "validation", "write_report": "whole",
}


def __getattr__(name: str) -> Any:
    """Import a function when it is first used: an export needs no fit, and a worker no report."""
    if name == "read_log":
        return import_module("heatertune.log").read_log
    if name in __all__:
        return getattr(import_module(f"heatertune.chain.{_HOMES.get(name, _STAGES)}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
