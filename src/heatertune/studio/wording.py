"""The sentences of the page: those of the chain and its errors, with the page's names for options; and suggestions.

A suggestion for a design that fails says what would pass, and what its button changes.
"""

from __future__ import annotations

import re
from collections.abc import Iterator, Mapping
from dataclasses import dataclass, field
from typing import Any, Final

from heatertune.proof.redesign import DesignResult
from heatertune.studio.loop_settings import StudioSettings

__all__ = ["SuggestedChange", "assumptions_text", "fault_text", "for_page", "mend_for"]


_OPTION: Final = re.compile(r"--([a-z]+(?:-[a-z]+)*)(?: NAME(?: or N|\|N)?| LOW HIGH| PCT)?")
#: where an option's name alone would make no sentence
_SENTENCES: Final = (
    (re.compile(r"--tag (.+?) --tag-column (.+?) to read"), r"the role zone for ‘\2’ to read"),
    (re.compile(r"\(--skip-empty leaves such rows out\)"), "(or tick that rows without a reading are left out)"),
    (re.compile(r"--power-full-scale with the reading at full power"), "the reading at full power"),
    (re.compile(r"\(--power-full-scale tells another reading at full power\)"), "(or another reading at full power)"),
    (re.compile(r"--power-full-scale would have to tell the reading"), "you would have to type the reading"),
    (re.compile(r"--run reads another"), "another can be chosen"),
    (re.compile(r"--append continues it"), "tick that it is continued"),
    (re.compile(r"Say --design DIR \(whose controller runs there\), or --map FILE\.toml"),
     "Type the folder of its design, or the map that says it"),
    (re.compile(r"say it in a small file: --map FILE\.toml"), "say it in a small file, the map (TOML)"),
    (re.compile(r"--log-interval with the seconds"), "the log's interval: the seconds"),
)
_NO_COLUMN: Final = re.compile(r"--([a-z]+)-(?:column|tag) none\b")
#: what the page has no control for: the sentence is whole without it
_LEFT_OUT: Final = re.compile(r",? or --accept [\w-]+|; --force exports these parameters anyway")
#: option → what the page calls it, where its name says too little
_CALLED: Final = {
    "temperature-unit": "the temperature's unit:", "time-unit": "the time's unit:", "tag": "the temperature's tag",
    "power-full-scale": "the reading at full power", "log-interval": "the log's interval",
    "run": "the choice of the run", "tag-column": "the column of the tags", "ambient": "the ambient temperature",
    "power-before": "the power before the log", "largest-power": "the largest power in this log",
    "range": "the sensor range", "input": "the analog input",
    "ms": "calm or brisk (Ms)", "sample-time": "the sampling interval TA", "tolerance": "the tolerance",
    "load-at": "‘load came’", "begins-at": "‘heat-up begins’",
}


def for_page(text: str) -> str:
    """Return a sentence without the options of the command line, in the names of the page."""
    for pattern, sentence in _SENTENCES:
        text = pattern.sub(sentence, text)
    text = _NO_COLUMN.sub(lambda match: f"no {match[1]} chosen", _LEFT_OUT.sub("", text))
    text = _OPTION.sub(lambda match: _CALLED.get(match[1], f"‘{match[1].replace('-', ' ')}’"), text)
    return re.sub(r":(?=[).,;]|$)", "", text) if "unit:" in text else text


def fault_text(problem: Exception) -> str:
    """Return the message about a fault of heatertune itself, and the remedy."""
    return (f"Something went wrong inside heatertune ({type(problem).__name__}). Log and settings are kept: move a "
            "control to continue; if it happens again, restart the studio and report what its terminal shows.")


_SWITCH: Final = re.compile(r",? and say --assume \w+=\S+?(?=[.;]|$)|--assume (\w+)=(\S+)")
_LIMIT: Final = re.compile(r"--limit ([\w-]+)=(\S+)")
_TOLERANCE: Final = re.compile(r"--tolerance ([\d.]*\d)")
_INTERVAL: Final = re.compile(r"--sample-time ([\d.]*\d)(?= --)")
_TA_AUTO: Final = re.compile(r"--sample-time auto")
_STRUCTURE: Final = re.compile(r"--structure (\w+)")
_MS: Final = re.compile(r"--ms ([\d.]*\d)")
_SETPOINT: Final = re.compile(r"--setpoint ([\d.]*\d)")
_KIND: Final = re.compile(r"(?:at )?--switch-kind (\w+)(?= --|[.;]|$)")
_PERIOD: Final = re.compile(r"(at |)--pwm-period ([\d.]*\d)")
_KINDS: Final = {"ssr": "solid-state relay"}
_BURST: Final = re.compile(r", and tried without --switch-kind")

#: options that are one setting each
_FIELDS: Final = {"--tolerance": "tolerance_degC", "--sample-time": "sample_time_s", "--setpoint": "setpoint_degC",
                  "--ms": "ms", "--structure": "structure", "--switch-kind": "switch_kind",
                  "--pwm-period": "pwm_period_s"}
#: of these, those that are a name, not a number
_NAMES: Final = ("--structure", "--switch-kind")
#: options of the design and of the conditions, which allow nothing
_ASKED: Final = ("--sample-time", "--setpoint", "--ms", "--structure", "--switch-kind", "--pwm-period")


@dataclass(frozen=True, slots=True, kw_only=True)
class SuggestedChange:
    """What is offered beside FAIL.

    Attributes:
        told: what would pass and its price, in a sentence or two.
        button: what is pressed; "" where nothing is known that helps.
        moved: settings that pressing it moves; none: it shows the design that was found.
    """

    message: str
    button: str = ""
    changes: Mapping[str, Any] = field(default_factory=dict)


def mend_for(result: DesignResult, settings: StudioSettings) -> SuggestedChange:
    """Return the offer of a design that was found for settings whose words fail."""
    if result.proof.verdict != "FAIL":
        notes = [note for note in result.notes if not note.startswith("Under ")]
        message = notes[0] if notes else "The optimum keeps every limit; the gains in front were found in haste."
        return SuggestedChange(message=_plain(message), button="Show the nearest design that passes")
    message = _plain(result.notes[-1]) if result.notes else "Nothing tried mends it."
    moved = dict(_moved(result.passes_with, settings))
    if not moved:
        return SuggestedChange(message=message)
    button = "Take that as known" if "assumptions" in moved else (
        "Ask for that" if {*result.passes_with[::2]} <= {*_ASKED} else "Allow that much")
    return SuggestedChange(message=message, changes=moved, button=button)


def assumptions_text(settings: StudioSettings) -> str:
    """Return the limits and assumptions other than the defaults, "" where there are none."""
    parts = [f"{name} = {setting}" for name, setting in settings.assumptions]
    parts += [f"{name.replace('-', ' ')} up to {value}" for name, _, value in
              (limit.partition("=") for limit in settings.limits)]
    if settings.tolerance_degC is not None:
        parts.append(f"±{settings.tolerance_degC:g} °C counts as settled")
    return f"Proven under what you allowed: {', '.join(parts)}." if parts else ""


def _moved(options: tuple[str, ...], settings: StudioSettings) -> Iterator[tuple[str, Any]]:
    """Return the settings that options mean: flags and values, in turn."""
    pairs = list(zip(options[::2], options[1::2], strict=True))
    switches = tuple(value.partition("=")[::2] for flag, value in pairs if flag == "--assume")
    limits = tuple(value for flag, value in pairs if flag == "--limit")
    if switches:
        yield "assumptions", (*settings.assumptions, *switches)
    if limits:
        names = {limit.partition("=")[0] for limit in limits}
        yield "limits", (*(own for own in settings.limits if own.partition("=")[0].strip() not in names), *limits)
    for flag, value in pairs:
        if flag in _FIELDS:
            yield _FIELDS[flag], None if value == "auto" else value if flag in _NAMES else float(value)


def _plain(message: str) -> str:
    """Return a sentence without options of the command line."""
    message = _SWITCH.sub(lambda match: f"{match[1]} = {match[2]}" if match[1] else "", message)
    message = _LIMIT.sub(lambda match: f"{match[1].replace('-', ' ')} up to {match[2]}", message)
    message = _INTERVAL.sub(r"TA = \1 s and", _TA_AUTO.sub("a TA found with the design", message))
    message = _STRUCTURE.sub(lambda match: f"the structure {match[1].upper()}", _MS.sub(r"Ms up to \1", message))
    message = _SETPOINT.sub(r"a setpoint of \1 °C", _BURST.sub("", message))
    message = _KIND.sub(lambda match: f"with a {_KINDS.get(match[1], match[1])}", message)
    message = _PERIOD.sub(lambda match: f"{match[1] or 'and '}a PWM period of {match[2]} s", message)
    message = for_page(_TOLERANCE.sub(r"a tolerance of \1 °C", message))
    return message if message.endswith(".") else f"{message}."
