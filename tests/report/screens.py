"""The screens of `heatertune design` for every controller and verdict, from values: no proof is run for their layout.

    python -m tests.report.screens        write them anew
"""

from dataclasses import replace
from pathlib import Path

from tests.report.conftest import DESIGN, HEATER

from heatertune.codec import encode as as_json
from heatertune.codec import plain
from heatertune.model import model_document
from heatertune.model.model_values import model_by_hand
from heatertune.pid import design_document as pid_document
from heatertune.plc import TARGETS, Certificate, Scaling, controller_for
from heatertune.plc.design import encode
from heatertune.proof.specification import GENERAL, preset
from heatertune.report.verdict_summary import design_brief

GOLDEN = Path(__file__).with_name("screens.txt")
VERDICTS = ("PASS", "FAIL", "NOT PROVEN")
NEAREST = ("heatertune", "design", "table4", "--target", "{}", "--out", "out/", "--limit", "overshoot=25%")


def criterion(value, limit, unit="%", bound="<=", **other):
    """A criterion as a proof's document holds it."""
    ok = limit is None or (value is not None and (value >= limit if bound == ">=" else value <= limit))
    return {"value": value, "limit": limit, "bound": bound, "unit": unit, "ok": ok, "where": "", "what": ""} | other


def proof_of(target, verdict):
    """A proof of 54 runs on 9 heaters that ended so."""
    fails = verdict == "FAIL"
    criteria = {
        "stability": criterion(1.0, 1.0, "1", ">="), "overshoot": criterion(24.1 if fails else 16.61, 20.0),
        "settling_time": criterion(None if fails else 1200.0, 1500.0, "s"), "limit_cycle": criterion(0.4, 1.0, "°C"),
        "ms": criterion(1.605, 2.0, "1"), "gain_margin": criterion(7.59, 1.7, "1", ">="),
        "phase_margin": criterion(47.6, 30.0, "°", ">="), "overflow": criterion(0.0, 0.0, "1"),
        "step_power": criterion(9.99, 10.0), "iae": criterion(6880.0, None, "°C·s"),
        "switchings": criterion(416.0, None, "1/h"),
    }
    findings = [{"name": "no-power", "effect": "told", "message": "", "accepted": False}]
    if verdict == "NOT PROVEN":
        findings.append({"name": "dead-time-open", "effect": "blocks", "message": "", "accepted": False})
    return {
        "verdict": verdict, "target": target, "criteria": criteria, "findings": findings,
        "runs": [{"model": f"heater {number % 9}"} for number in range(54)], "scenario": {"setpoint_degC": 53.3},
        "specification": {"name": GENERAL, "changed": [], "limits": as_json(preset(GENERAL).limits)}, "assumed": {}, "stated_settings": {}, "faults": [],
        "remarks": ["dead time 0.48 s longer, for the input module"], "actuator": {"pwm_period_s": 4.0},
        "not_tested": ["mains voltage (at −10 % a heater has 2.98 % of power left over)",
                       "settings of integral_inward, limit, manual_flag (they change no run)"]}


def documents_of(target, verdict):
    """The documents of a design that ended so."""
    fitted, controller = model_by_hand(HEATER), controller_for(target)
    words = encode(replace(DESIGN, sample_time_s=controller.timer.round(DESIGN.sample_time_s)), target, scaling=Scaling())
    files = controller.export(words, Certificate(verdict="PASS", setpoint_degC=53.3)) if verdict == "PASS" else ()
    written = {"target": target, "words": dict(words.values), "sample_time_s": words.sample_time_s, "verdict": verdict,
               "scaling": {"low_degC": 0.0, "high_degC": 100.0}, "setpoint_ramp": None, "setpoint_degC": 53.3,
               "files": sorted(files), "search": None}
    return {"model": plain(model_document.to_document(fitted)), "words": written, "proof": proof_of(target, verdict),
            "pid": plain(pid_document.to_document(DESIGN, fitted))}


def screen_of(target, verdict):
    """What the terminal shows."""
    nearest = [word.format(target) for word in NEAREST] if verdict == "FAIL" else ()
    return design_brief(documents_of(target, verdict), "out/", nearest)


def screens():
    """All of them, one after the other."""
    return "\n".join(f"$ {target}, {verdict}\n{screen_of(target, verdict)}\n" for target in TARGETS for verdict in VERDICTS)


if __name__ == "__main__":
    GOLDEN.write_text(screens(), encoding="utf-8")
