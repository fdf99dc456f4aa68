"""The commissioning record: the words with their ticks, the steps on site, what was assumed, who signs."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from heatertune.codec import decode
from heatertune.options import options_of
from heatertune.plc import Scaling, Switch, controller_for
from heatertune.plc.commissioning import commissioning
from heatertune.plc.inputs import described
from heatertune.plc.typed import typed_table
from heatertune.proof.profile import Profile
from heatertune.proof.specification import LIMITS
from heatertune.report.html import bullets, steps, table, text_of, tick
from heatertune.report.text import figure, ramp_note, search_notes, typed
from heatertune.settings import Conditions, SensorSettings

__all__ = ["assumed", "limits", "signature", "site", "specification", "words"]

Documents = Mapping[str, Mapping[str, Any]]

def signature(_: Documents) -> str:
    """Return the lines for who put it into service; empty, for a report has no date of its own."""
    lines = [["plant and heater", ""], ["commissioned by (name)", ""], ["date", ""], ["signature", ""],
             ["remarks", ""]]
    return f'<div class="sign"><h2>Commissioned</h2>{table(["", "filled in by hand"], lines)}</div>'


def words(documents: Documents) -> str:
    """Return the words, in the order in which they are typed in, each with a box to tick."""
    document = documents["words"]
    typed_in = typed(document)
    heads, values, cells = typed_table(typed_in)
    rows = [[tick(f"word-{row.name}", f"{row.name} typed in"), *line[:-1], row.format, row.meaning]
            for row, line in zip(typed_in, cells, strict=True)]
    files = "".join(f"<li><code>{text_of(name)}</code></li>" for name in document["files"])
    scale = document["scaling"]
    listed = table(["typed", *heads[:-1], "format", "meaning, unit"], rows, numeric=[1 + i for i in values],
                   source=controller_for(document["target"]).title)
    return (
        f"<h2>Words for {text_of(document['target'])}</h2><p>In the order in which they are typed in. Sensor "
        f"{described(Scaling(**scale))}; call every "
        f"{figure(document['sample_time_s'])} s. The setpoint of the proof, {figure(document['setpoint_degC'])} °C, is "
        f"{document['setpoint_units']} units.</p>"
        f"{listed}{bullets([*ramp_note(document), *search_notes(document)])}<ul>{files}</ul>"
    )


def site(documents: Documents) -> str:
    """Return the steps on site: where the words go, what to watch, what to do, how to go back."""
    target = documents["words"]["target"]
    manual = commissioning(target)
    parts = "".join(
        f"<h3>{text_of(title)}</h3>{steps(f'step-{i}', items)}" for i, (title, items) in enumerate(manual.steps.items())
    )
    return f'<h2>Into service</h2>{parts}<p class="soft">Source: {text_of(manual.facts)}</p>'


def assumed(documents: Documents) -> str:
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
        ["duration of the proof", f"{story['duration_s']:.0f}", "s", "from the slowest possible heater"],
    ]
    rows += [[part["label"], f"{part['begin_s']:.0f}", "s", "the story of the specification, in times that suit the "
              "slowest possible heater"] for part in documents["pictures"]["phases"][1:]]
    if switch is not None:
        rows += [_row(name, switch[key]) for name, key in (
            ("pwm_period_s", "pwm_period_s"), ("pwm_resolution_s", "resolution_s"), ("minimum_on_s", "minimum_on_s"),
            ("minimum_off_s", "minimum_off_s"))]
        if switch["minimum_rule"] == "carry":
            rows.append(["what a pulse leaves", "made up in the next one", "", options_of(Conditions)["pwm_rule"].flag])
    points = controller_for(documents["words"]["target"]).switches
    known = documents["proof"]["known"]
    settings = [[point.name, point.default, ", ".join(proven), point.why]
                for point in points if not point.in_manual and (proven := _proven(point, known))]
    by_hand = ", ".join(point.name for point in points if point.in_manual)
    open_points = (
        "<h3>What the manual leaves open</h3><p>The proof ran under every setting"
        + (f", but for what shows in manual alone: {by_hand}.</p>" if by_hand else ".</p>")
        + table(["point", "default", "settings proven", "what is open"], settings,
                source="DIFFERENCES.md of the controller")
        if settings else ""
    )
    return (
        "<h2>Assumed</h2>"
        + table(["", "value", "unit", "given by"], rows, numeric=(1,), source="options of the command, else defaults")
        + open_points
    )


def _proven(point: Switch, known: Mapping[str, str]) -> tuple[str, ...]:
    """Return the settings that ran: of a choice the one that was made, and the default; none where that is chosen."""
    chosen = known.get(point.name, point.default)
    if point.chosen:
        return () if chosen == point.default else (chosen, point.default)
    return point.settings


def _row(name: str, value: float) -> list[str]:
    """Return what one of the `Conditions` was, with its unit and where it came from."""
    its = options_of(Conditions)[name]
    return [its.label or its.what, figure(value), its.unit, its.given_by]


def specification(documents: Documents) -> str:
    """Return what was asked for, in the user's words, with its reasons; empty where limits were given as they are."""
    asked = documents["proof"]["specification"]
    if asked is None:
        return ""
    rows = [[name, " and ".join(values), LIMITS[name].what, asked["reasons"].get(name, "")]
            for name, values in asked["limits"].items() if values]
    if (profile := asked.get("profile")) is not None:
        rows.append(["profile", decode(Profile, profile, "proof.json").told,
                     "ramps and soaks along which your own program leads the setpoint", ""])
    return (f"<h2>Asked</h2><p>The specification {text_of(asked['name'])}.</p>"
            + table(["limit", "value", "meaning", "why"], rows, source="heatertune spec"))


def limits(documents: Documents) -> str:
    """Return what the proof does not say."""
    proof = documents["proof"]
    ends = f"Setpoints above {figure(proof['scenario']['setpoint_degC'])} °C, and below those of the story."
    unproven = [
        "Heaters outside the listed models: nothing is claimed for them.",
        "A sensor that is wrong, a relay that sticks, a jittering timer (`heatertune verify --samples` draws this).",
        ends,
        *(f"Not tested: {part}." for part in proof["not_tested"]),
    ]
    return f"<h2>What was not proven</h2>{bullets(unproven)}"
