"""The commissioning record of all zones on one page: verdict, a picture of the run, and each zone's words to tick."""

from __future__ import annotations

import hashlib
from collections.abc import Mapping, Sequence
from typing import Final

from heatertune import __version__
from heatertune.codec import ZONES_FILE, to_json
from heatertune.plc import controller_for
from heatertune.plc.inputs import describe_range
from heatertune.plc.keyed_entry import setpoint_entry, typed_table, typed_words
from heatertune.report.html import BLANK, bullets, page, picture, table, text_of, tick, with_code
from heatertune.report.plots import new_figure
from heatertune.report.report_text import figure
from heatertune.zones.joint_proof import JointProof
from heatertune.zones.zone_export import export_zones, text_of_zone
from heatertune.zones.zones_folder import to_document

__all__ = ["block_of_zone", "design_files", "zone_record"]

_HEADS: Final = ("zone", "setpoint [°C]", "gain [°C/%]", "time constant [s]", "dead time [s]", "K [%/°C]", "TN [s]",
                 "TV [s]", "start of the PWM period [s]")
#: target → where the words of the first zone stand in the program
_BLOCKS: Final = {
    "s7-300": " The parameters stand in DB 100.", "s5-ob251": " The parameters stand in DB 30.",
    "fb41": " The parameters stand in DB 41."}
#: target → where the power that decoupling adds can be watched
_ADDED: Final = {"fb41": "DISV of its instance of FB 41", "iec-pid": "HeaterAdded of its program"}
_ACCEPTANCE: Final = (
    "Heat up all zones together and note the highest temperature of each.",
    "Change the setpoint of one zone, wait until all zones rest, and note how far its neighbours deviate.",
    "Switch one zone off and on again; its neighbours return to their setpoints.")


def design_files(proof: JointProof, *, force: bool) -> dict[str, str | bytes]:
    """Return the files of a design of zones: document, record, and the programs of a PASS or where it is forced.

    Args:
        proof: of all zones together.
        force: export although the verdict is not PASS.

    Raises:
        ExportRefused, InputError: as `export_zones`.
    """
    programs = export_zones(proof, force=force) if force or proof.verdict == "PASS" else {}
    document = to_document(proof, programs)
    return {ZONES_FILE: to_json(document), **programs, "record.html": zone_record(proof, document, list(programs))}


def zone_record(proof: JointProof, document: Mapping[str, object], files: Sequence[str]) -> str:
    """Return the page as HTML.

    Args:
        proof: of all zones together.
        document: of the proof, whose digest the page bears.
        files: names of the exported programs; none where the verdict is not PASS.
    """
    title = f"{len(proof.words)} zones: {', '.join(proof.fitted.network.zones)}"
    digest = hashlib.sha256(to_json(document).encode()).hexdigest()[:16]
    parts = [_verdict(proof), _overview(proof), _picture(proof), *_words(proof, refused=not files), _decoupling(proof),
             _files(files),
             f"<h2>Acceptance test</h2>{_acceptance(proof)}", _signatures(proof, digest)]
    return page(title, "\n".join(f"<section>{part}</section>" for part in parts if part), mark=digest)


def _verdict(proof: JointProof) -> str:
    kind = proof.verdict.lower().replace(" ", "-")
    first, *others = proof.summary().splitlines()
    return f'<p class="verdict {kind}">{text_of(first)}</p>{bullets(others)}'


def _overview(proof: JointProof) -> str:
    network, rows = proof.fitted.network, []
    for zone, design in enumerate(proof.design.designs):
        values = (proof.specification.setpoints_degC[zone], network.gains_degC_per_pct[zone],
                  network.time_constants_s[zone], network.dead_times_s[zone], design.gain_pct_per_degC,
                  design.integral_time_s, design.derivative_time_s, proof.offsets_s[zone])
        rows.append([network.zones[zone], *map(figure, values)])
    return f"<h2>Zones</h2>{table(_HEADS, rows, numeric=tuple(range(1, len(_HEADS))))}"


def _picture(proof: JointProof) -> str:
    trace, hours = proof.trace, proof.trace.time_s / 3600.0
    drawn, (top, low) = new_figure(2, 5.0, sharex=True, height_ratios=(3, 1))
    for zone, name in enumerate(proof.fitted.network.zones):
        top.plot(hours, trace.temperatures_degC[:, zone], color=f"C{zone}", linewidth=1.0, label=name)
        top.plot(hours, trace.setpoints_degC[:, zone], color=f"C{zone}", linewidth=0.7, linestyle=":")
        low.plot(hours, trace.powers_pct[:, zone], color=f"C{zone}", linewidth=0.7)
    top.set_ylabel("temperature [°C]")
    low.set_ylabel("power [%]")
    low.set_xlabel("time [h]")
    top.legend(loc="lower right", ncols=4)
    return picture(drawn, f"The run {proof.runs[0]}: all zones, setpoints dotted.", moves=False)


def _words(proof: JointProof, *, refused: bool) -> list[str]:
    sections = []
    for number, (zone, words) in enumerate(zip(proof.fitted.network.zones, proof.words, strict=True)):
        setpoint = proof.specification.setpoints_degC[number]
        heads, values, cells = typed_table(typed_words(words, setpoint))
        rows = [(tick(f"z{number}-{row}", f"{zone}: {cell[1]}"), *(
            text_of_zone(words.target, text, number) for text in cell)) for row, cell in enumerate(cells)]
        warning = '<p class="fail">Do not enter: these parameters are not proven.</p>' if refused else ""
        source = controller_for(words.target).title
        entry = text_of_zone(words.target, setpoint_entry(words, setpoint), number)
        blocks = block_of_zone(words.target, number)
        sections.append(
            f"<h2>Zone {text_of(zone)}: parameters for {text_of(words.target)}</h2>{warning}"
            f"<p>Sensor {describe_range(words.scaling)}; call every {figure(words.sample_time_s)} s. Setpoint of the "
            f"proof: {figure(setpoint)} °C; enter {text_of(entry)}.{blocks}</p>"
            + table(("done", *heads), rows, numeric=tuple(place + 1 for place in values), source=source))
    return sections


def _decoupling(proof: JointProof) -> str:
    """Return what the program of each zone adds for its neighbours, and how that is checked; "" without decoupling."""
    decoupling, zones = proof.design.decoupling, proof.fitted.network.zones
    if decoupling is None:
        return ""
    rows = [[zones[zone], zones[other], figure(factor), figure(decoupling.references_degC[other])]
            for zone, row in enumerate(decoupling.pct_per_degC) for other, factor in enumerate(row) if factor != 0.0]
    where = _ADDED[proof.words[0].target]
    steps = [f"At rest at the proven setpoints, {where} is about 0 in every zone.",
             "Raise the setpoint of one zone by 1 °C and wait until all zones rest: in each neighbour the added power "
             "has changed by what the table says for it.",
             "Unplug the sensor of a zone: that zone goes off, and in its neighbours its part is 0.",
             "Other setpoints for good, or other heaters: design again."]
    steps_html = "".join(f"<li>{tick(f'decoupled-{row}', line)} {text_of(line)} {BLANK}</li>"
                         for row, line in enumerate(steps))
    heads = ("to zone", "for zone", "power [%/°C]", "above [°C]")
    return f"<h2>Power for the neighbours' temperatures</h2>{table(heads, rows, numeric=(2, 3))}<ol>{steps_html}</ol>"


def block_of_zone(target: str, number: int) -> str:
    """Return where the words of a zone stand in the program of all zones, "" where each zone has its own program."""
    return text_of_zone(target, _BLOCKS.get(target, ""), number)


def _files(files: Sequence[str]) -> str:
    return f"<h2>Programs</h2>{bullets([f'`{name}`' for name in files])}" if files else ""


def _acceptance(proof: JointProof) -> str:
    spread = proof.specification.spread_degC
    lines = [*_ACCEPTANCE, *([] if spread is None else [
        "Let all zones cool down, start them at the same time, and note the largest difference between two zones: it "
        f"exceeds that between their setpoints by {figure(spread)} °C at the most."])]
    return "<ol>" + "".join(
        f"<li>{tick(f'accept-{row}', line)} {with_code(line)} {BLANK}</li>" for row, line in enumerate(lines)
    ) + f"</ol><p>Tolerance at rest: {figure(proof.specification.limits.tolerance_degC)} °C.</p>"


def _signatures(proof: JointProof, digest: str) -> str:
    rows = [[name, BLANK, BLANK, BLANK] for name in ("commissioned by", "accepted by")]
    return (f"<h2>Signatures</h2>{table(('', 'name', 'date', 'signature'), rows)}"
            f"<p class=\"soft\">Log {text_of(proof.fitted.log)}; proof <code>{digest}</code>; heatertune "
            f"{text_of(__version__)}.</p>")
