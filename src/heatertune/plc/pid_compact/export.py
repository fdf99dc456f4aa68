"""Words → SCL source, the rollback as SCL source, and a table for a watch table; none was tried in TIA Portal."""

from __future__ import annotations

import csv
import io
from collections.abc import Sequence
from typing import Final

from heatertune.plc.cpu.letters import in_ascii
from heatertune.plc.keyed_entry import as_typed
from heatertune.plc.pid_compact.source import CALL, LOAD, ROLLBACK, assignments, call, load, made_by, rollback, tick_s
from heatertune.plc.pid_compact.words import BlockTags
from heatertune.plc.st.source import comment
from heatertune.plc.words import Certificate, WordField, Words

__all__ = ["COLUMNS", "export_words"]

#: of a watch table, in the order of its editor
COLUMNS: Final = ("Name", "Address", "Display format", "Monitor value", "Modify value", "Comment")


def export_words(
    tags: BlockTags, fields: Sequence[WordField], words: Words, certificate: Certificate
) -> dict[str, str | bytes]:
    """Return the three files; the same words and certificate give the same bytes."""
    head = comment(*_head(tags, words, certificate), *_by_hand(tags, words, certificate))
    short = comment(*_rollback(certificate))
    return {f"{tags.files}_words.scl": f"{head}{load(tags, words, certificate.actuator)}\n{call(tags)}",
            f"{tags.files}_rollback.scl": short + rollback(tags),
            f"{tags.files}_watch.csv": _watch(tags, fields, words, certificate)}


def _head(tags: BlockTags, words: Words, certificate: Certificate) -> tuple[str, ...]:
    scale = words.scaling
    return (
        f"heater controller: words of {tags.block} (S7-1200/1500), V2 and later, for the instance DB {tags.instance}",
        f"sensor {scale.low_degC:g}...{scale.high_degC:g} degC; TA: Cycle = {words.sample_time_s:g} s; {tags.power}"
        f"{f' and {tags.cooler}' if tags.cools else ''} in percent",
        *certificate.head,
        "not tried in TIA Portal",
    )


def _by_hand(tags: BlockTags, words: Words, certificate: Certificate) -> list[str]:
    """Return what remains to be done by hand, numbered."""
    actuator = certificate.actuator
    why = made_by(tags, words, actuator)
    interval = words.sample_time_s if actuator is None else tick_s(tags, words, actuator)
    cooler = (f" and {tags.cooler}_PWM to the cooler's", f" and {tags.cooler}") if tags.cools else ("", "")
    wired = (f"wire {tags.pulses} to the heater's switch{cooler[0]}" if why is None else
             f"wire {tags.power}{cooler[1]} through a PWM of yours as it was proven; {tags.pulses} is not it: {why}")
    proven = certificate.setpoint_degC
    steps = (
        f"create the technology object {tags.block}, named {tags.instance} (or change the name here), and generate the "
        "blocks of this external source",
        f"call {LOAD} in a start-up OB (OB 100): each start-up then has these words, whatever was retained; "
        f"{tags.saved('Gain')} and its neighbours keep the ones of before",
        f"call {CALL} in a cyclic interrupt OB every {1000.0 * interval:g} ms, with your setpoint in degC and your "
        "analog input",
        wired,
        "setpoint: " + ("another one than the proven one is not proven" if proven is None else
                        f"{proven:g} degC as proven; another one is not proven"),
        "the mode is yours: Mode = 4 and ManualValue first, then Mode = 3 (automatic) with an edge of ModeActivate; "
        "Mode is retentive and comes back at start-up",
    )
    return ["remains to be done by hand:", *(f"  {number}. {step}" for number, step in enumerate(steps, start=1))]


def _rollback(certificate: Certificate) -> tuple[str, ...]:
    return (
        f"back to the parameters of before: call {ROLLBACK} once, and take {LOAD} out of the start-up OB, which would "
        "load the new ones again",
        "LoadBackUp copies CtrlParamsBackUp to Retain.CtrlParams and falls back to FALSE by itself; "
        f"{LOAD} or the last tuning filled it",
        "limits and other configuration stay as they are",
        *certificate.head[:1],
        "not tried in TIA Portal",
    )


def _watch(tags: BlockTags, fields: Sequence[WordField], words: Words, certificate: Certificate) -> str:
    text = io.StringIO()
    table = csv.writer(text, lineterminator="\n")
    notes = (*_head(tags, words, certificate),
             "columns as the editor of a watch table has them, for copying; its own files are no CSV",
             "write the parameters in inactive mode only (Mode = 0)")
    for note in notes:
        table.writerow([f"// {note}"])
    table.writerow(COLUMNS)

    def row(tag: str, form: str, value: str, comment: str) -> None:
        table.writerow([f'"{tags.instance}".{tag}', "", form, "", value, comment])

    for field in fields:
        if field.name in tags.parameters:
            row(field.address, _format(field.format), as_typed(words.values[field.name], field.format), field.comment)
    for tag, value, meaning in assignments(tags, words, certificate.actuator):
        row(tag, "Bool" if value in ("TRUE", "FALSE") else "Floating-point number" if "." in value else "DEC+/-",
            value, meaning)
    row("LoadBackUp", "Bool", "", "TRUE loads CtrlParamsBackUp, the parameters of before")
    return in_ascii(text.getvalue())


def _format(format_: str) -> str:
    return {"REAL": "Floating-point number", "BOOL": "Bool"}.get(format_, "DEC+/-")
