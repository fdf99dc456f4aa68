"""The whole chain as functions, one per stage; the results of later stages can lead back to earlier ones.

    log = read_log("table4")
    model = fit(log)
    design = tune(model, target="s5-ob251")
    words = encode(design, "s5-ob251", model)
    proof = prove(words, model)
    write_report(log, model, design, proof, "out/")

This package contains no algorithms of its own: each function calls its stage. `design` runs the whole chain.
"""

from typing import TYPE_CHECKING

from heatertune.lazy import lazy_attributes

__all__ = [
    "compare", "design", "encode", "export", "fit", "fit_known", "fit_together", "plan", "prove", "read_log",
    "tune", "validate", "write_report",
]

if TYPE_CHECKING:
    from heatertune.chain.facade import plan, validate
    from heatertune.chain.pipeline import design, write_report
    from heatertune.chain.stages import encode, export, fit, fit_known, fit_together
    from heatertune.log import read_log
    from heatertune.plc.design import tune
    from heatertune.proof import prove
    from heatertune.proof.comparison import compare

# imported when it is first used: an export needs no fit, and a worker no report
__getattr__, __dir__ = lazy_attributes(__name__, {
    "chain.facade": ("plan", "validate"),
    "chain.stages": ("encode", "export", "fit", "fit_known", "fit_together"),
    "chain.pipeline": ("design", "write_report"),
    "log": ("read_log",),
    "plc.design": ("tune",),
    "proof": ("prove",),
    "proof.comparison": ("compare",),
})
