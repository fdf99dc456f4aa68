"""Model + words → Trace → verdict: the closed loop with PWM, sensor and the PLC's own arithmetic."""

from typing import TYPE_CHECKING

from heatertune.lazy import lazy_attributes

if TYPE_CHECKING:
    from heatertune.plc.pwm import Actuator, pid_compact, pulsegen
    from heatertune.proof.criteria import Criterion, LoopLimits
    from heatertune.proof.loop import simulate
    from heatertune.proof.monte_carlo.draw import SampleProof, SampleRequest, SampleSpread, prove_samples, replay
    from heatertune.proof.proof import Proof, RunResult, prove_models
    from heatertune.proof.prove_words import prove
    from heatertune.proof.report_curves import simulate_wish
    from heatertune.proof.scenario import (
        Load,
        Mains,
        NewSetpoint,
        PlcPower,
        Scenario,
        TemperatureStep,
        paper_scenario,
        scenario_for,
    )
    from heatertune.proof.test_sequence import TestSequence, story_for
    from heatertune.proof.trace import Trace
    from heatertune.proof.verdict import Acceptance, Coverage, Interlock

__all__ = [
    "Acceptance", "Actuator", "Coverage", "Criterion", "Interlock", "Load", "LoopLimits", "Mains", "NewSetpoint",
    "PlcPower", "Proof", "RunResult", "SampleProof", "SampleRequest", "SampleSpread", "Scenario", "TemperatureStep",
    "TestSequence", "Trace", "paper_scenario", "pid_compact", "prove", "prove_models", "prove_samples", "pulsegen",
    "replay", "scenario_for", "simulate", "simulate_wish", "story_for",
]

__getattr__, __dir__ = lazy_attributes(__name__, {
    "plc.pwm": ("Actuator", "pid_compact", "pulsegen"),
    "proof.verdict": ("Acceptance", "Coverage", "Interlock"),
    "proof.criteria": ("Criterion", "LoopLimits"),
    "proof.prove_words": ("prove",),
    "proof.report_curves": ("simulate_wish",),
    "proof.loop": ("simulate",),
    "proof.proof": ("Proof", "RunResult", "prove_models"),
    "proof.monte_carlo.draw": ("SampleProof", "SampleRequest", "SampleSpread", "prove_samples", "replay"),
    "proof.scenario": (
        "Load", "Mains", "NewSetpoint", "PlcPower", "Scenario", "TemperatureStep", "paper_scenario", "scenario_for"),
    "proof.test_sequence": ("TestSequence", "story_for"),
    "proof.trace": ("Trace",),
})
