"""What the proof was told, and what it does not say: asked, assumed, left open."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from heatertune.codec import decode
from heatertune.options import options_of
from heatertune.plc import OpenPoint, controller_for
from heatertune.proof.profile import Profile
from heatertune.proof.specification import LIMITS
from heatertune.report.html import bullets, table, text_of
from heatertune.report.text import figure
from heatertune.settings import Conditions, SensorSettings

__all__ = ["assumption_text", "limits", "specification"]

Documents = Mapping[str, Mapping[str, Any]]


def assumption_text(documents: Documents) -> str:
    """Return what the proof was told about the plant, each with its unit and where it came from."""
    proof, scale = documents["proof"], documents["words"]["scaling"]
    story, switch, limit = proof["scenario"], proof["actuator"], proof["limits"]
    sensor = options_of(SensorSettings)["range_degC"]
    rows = [
        ["sensor at the lowest reading", figure(scale["low_degC"]), "°C", sensor.flag],
        ["sensor at the highest reading", figure(scale["high_degC"]), "°C", sensor.flag],
        *([["range of the analog module", scale["input"], "", "--input"]] if scale.get("input") else []),
        _row("setpoint_degC", story["setpoint_degC"]),
        _row("noise_degC", story["noise_degC"]),
        _row("tolerance_degC", limit["tolerance_degC"]),
        ["duration of the proof", f"{story['duration_s']:.0f}", "s", "from the slowest plausible heater"],
    ]
    rows += [[part["label"], f"{part['begin_s']:.0f}", "s", "the test sequence of the specification, with "
              "durations for the slowest plausible heater"] for part in documents["pictures"]["phases"][1:]]
    if switch is not None:
        rows += [_row(name, switch[key]) for name, key in (
            ("pwm_period_s", "pwm_period_s"), ("pwm_resolution_s", "resolution_s"), ("minimum_on_s", "minimum_on_s"),
            ("minimum_off_s", "minimum_off_s"))]
        if switch.get("cooling_gain") is not None:
            told = ("cooling_gain", "cooling_minimum_on_s", "cooling_minimum_off_s")
            rows += [_row(name, switch[name]) for name in told if switch.get(name) is not None]
        if switch["minimum_rule"] == "carry":
            rows.append(["rest of a pulse", "carried to the next one", "", options_of(Conditions)["pwm_rule"].flag])
    points = controller_for(documents["words"]["target"]).switches
    known = documents["proof"]["stated_settings"]
    settings = [[point.name, point.default, ", ".join(proven), point.reason]
                for point in points if not point.in_manual and (proven := _proven(point, known))]
    by_hand = ", ".join(point.name for point in points if point.in_manual)
    open_points = (
        "<h3>Open points of the manual</h3><p>The proof ran under every setting"
        + (f", except for points that only show in manual mode: {by_hand}.</p>" if by_hand else ".</p>")
        + table(["open point", "default", "settings proven", "what is open"], settings,
                source="DIFFERENCES.md of the controller")
        if settings else ""
    )
    return (
        "<h2>Assumptions</h2>"
        + table(["", "value", "unit", "given by"], rows, numeric=(1,),
                source="options of the command, otherwise defaults")
        + open_points
    )


def _proven(point: OpenPoint, known: Mapping[str, str]) -> tuple[str, ...]:
    """Return the settings that ran: of a choice the one that was made, and the default; none where that is chosen."""
    chosen = known.get(point.name, point.default)
    if point.chosen:
        return () if chosen == point.default else (chosen, point.default)
    return point.settings


def _row(name: str, value: float) -> list[str]:
    """Return what one of the `Conditions` was, with its unit and where it came from."""
    its = options_of(Conditions)[name]
    return [its.label or its.quantity, figure(value), its.unit, its.given_by]


def specification(documents: Documents) -> str:
    """Return what was asked for, in the user's words, with its reasons; empty where limits were given as they are."""
    asked = documents["proof"]["specification"]
    if asked is None:
        return ""
    rows = [[name, " and ".join(values).replace("degC", "°C"), LIMITS[name].description, asked["reasons"].get(name, "")]
            for name, values in asked["limits"].items() if values]
    if (profile := asked.get("profile")) is not None:
        rows.append(["profile", decode(Profile, profile, "proof.json").label,
                     "ramps and soaks that your own program runs", ""])
    return (f"<h2>Specification</h2><p>The specification {text_of(asked['name'])}.</p>"
            + table(["limit", "value", "meaning", "reason"], rows, source="heatertune spec"))


def limits(documents: Documents) -> str:
    """Return what the proof does not say."""
    proof = documents["proof"]
    ends = f"Setpoints above {figure(proof['scenario']['setpoint_degC'])} °C, and below those of the test sequence."
    unproven = [
        "Heaters outside the listed models.",
        "A faulty sensor, a stuck relay, a jittering timer (see `heatertune verify --samples`).",
        ends,
        *(f"Not tested: {part}." for part in proof["not_tested"]),
    ]
    return f"<h2>What was not proven</h2>{bullets(unproven)}"
