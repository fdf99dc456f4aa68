"""Model + words → Trace → verdict: the closed loop with PWM, sensor and the PLC's own arithmetic."""

from typing import TYPE_CHECKING

from heatertune.lazy import offered

if TYPE_CHECKING:
    from heatertune.plc.pwm import Actuator, pid_compact, pulsegen
    from heatertune.proof.acceptance import Acceptance
    from heatertune.proof.coverage import Coverage
    from heatertune.proof.criteria import Criterion, Limits
    from heatertune.proof.fitted import prove
    from heatertune.proof.ideal import simulate_wish
    from heatertune.proof.interlock import Interlock
    from heatertune.proof.judging import judge
    from heatertune.proof.loop import simulate
    from heatertune.proof.proving import Proof, RunResult, prove_models
    from heatertune.proof.sampled import SampleProof, prove_samples
    from heatertune.proof.samples import Drawing, Spread, replay
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
    from heatertune.proof.story import Story, story_for
    from heatertune.proof.trace import Trace

__all__ = [
    "Acceptance",
    "Actuator",
    "Coverage",
    "Criterion",
    "Drawing",
    "Interlock",
    "Limits",
    "Load",
    "Mains",
    "NewSetpoint",
    "PlcPower",
    "Proof",
    "RunResult",
    "SampleProof",
    "Scenario",
    "Spread",
    "Story",
    "TemperatureStep",
    "Trace",
    "judge",
    "paper_scenario",
    "pid_compact",
    "prove",
    "prove_models",
    "prove_samples",
    "pulsegen",
    "replay",
    "scenario_for",
    "simulate",
    "simulate_wish",
    "story_for",
]

__getattr__, __dir__ = offered(__name__, {
    "plc.pwm": ("Actuator", "pid_compact", "pulsegen"),
    "proof.acceptance": ("Acceptance",),
    "proof.coverage": ("Coverage",),
    "proof.criteria": ("Criterion", "Limits"),
    "proof.fitted": ("prove",),
    "proof.ideal": ("simulate_wish",),
    "proof.interlock": ("Interlock",),
    "proof.judging": ("judge",),
    "proof.loop": ("simulate",),
    "proof.proving": ("Proof", "RunResult", "prove_models"),
    "proof.sampled": ("SampleProof", "prove_samples"),
    "proof.samples": ("Drawing", "Spread", "replay"),
    "proof.scenario": (
        "Load", "Mains", "NewSetpoint", "PlcPower", "Scenario", "TemperatureStep", "paper_scenario", "scenario_for"),
    "proof.story": ("Story", "story_for"),
    "proof.trace": ("Trace",),
})
