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
    "compare", "design", "encode", "export", "fit", "fit_known", "fit_together", "plan", "prove", "read_log",
    "supervise", "tune", "validate", "write_report",
]

if TYPE_CHECKING:
    from heatertune.chain.experiment import plan
    from heatertune.chain.stages import export, fit, fit_known, fit_together
    from heatertune.chain.supervision import supervise
    from heatertune.chain.validation import validate
    from heatertune.chain.whole import design, write_report
    from heatertune.log import read_log
    from heatertune.plc.design import encode, tune
    from heatertune.proof import prove
    from heatertune.proof.targets import compare

_HOMES = {
    **dict.fromkeys(("export", "fit", "fit_known", "fit_together"), "chain.stages"),
    **dict.fromkeys(("design", "write_report"), "chain.whole"), "plan": "chain.experiment",
    "supervise": "chain.supervision", "validate": "chain.validation", "read_log": "log",
    **dict.fromkeys(("encode", "tune"), "plc.design"),
    "prove": "proof", "compare": "proof.targets",
}


def __getattr__(name: str) -> Any:
    """Import a function when it is first used: an export needs no fit, and a worker no report."""
    if name in _HOMES:
        return getattr(import_module(f"heatertune.{_HOMES[name]}"), name)
    raise AttributeError(f"module {__name__!r} has no attribute {name!r}")
