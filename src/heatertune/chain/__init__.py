"""The whole chain as functions; it hands later stages to earlier ones where a loop goes back.

    log = read_log("table4")
    model = fit(log)
    design = tune(model, target="s5-ob251")
    words = encode(design, target="s5-ob251")
    proof = prove(words, model)
    write_report(log, model, design, proof, "out/")

There is no algorithm here: each function asks the stage that knows. `design` does it all.
"""

from heatertune.chain.experiment import plan
from heatertune.chain.stages import encode, export, fit, fit_known, fit_together, prove, tune
from heatertune.chain.targets import compare
from heatertune.chain.validation import validate
from heatertune.chain.whole import design, write_report
from heatertune.log import read_log

__all__ = [
    "compare", "design", "encode", "export", "fit", "fit_known", "fit_together", "plan", "prove", "read_log", "tune",
    "validate", "write_report",
]
