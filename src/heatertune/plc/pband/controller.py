"""The controllers: one class for each make, from one table, with one law."""

from __future__ import annotations

from collections.abc import Mapping
from functools import partial
from typing import Any, Final

from heatertune.pid.design_values import Timer
from heatertune.plc.controller import Controller
from heatertune.plc.core import ControllerState, StepFunctions, count
from heatertune.plc.keyed_entry import entry_texts
from heatertune.plc.pband.export import export_words, from_text, loaders, stem_of
from heatertune.plc.pband.makes import MAKES, Make, field_of
from heatertune.plc.pband.step import COLD, PbandAssumptions, step
from heatertune.plc.pband.words import (
    COUNTS,
    block_of,
    by_role,
    consistent,
    design_of,
    display_text,
    oddities,
    period_of,
    periods_of,
    values_of,
    with_period,
)
from heatertune.plc.words import Cycle, EntryChange, Words

__all__ = ["INSTRUMENTS"]

#: TV at which the filter of the tuning has the lag of the words: its weight is one number [s]
_USUAL_TV_S: Final = 20.0

_CAN: Final = (
    "P, PI, PD and PID that heats, its gain as a proportional band; time-proportional pulses of its own",
    "exported as a parameter sheet in the order of the menu and as a list of registers, both of which read back",
)
_CANNOT: Final = (
    "its arithmetic is not published: the proof tries what is usual, see DIFFERENCES.md",
    "no setpoint ramp, boost, cooling or feed-forward; auto-tuning and self-tuning must stay off",
)


def _begin(make: Make) -> Any:
    def begin(_self: Controller, words: Words, assume: PbandAssumptions) -> ControllerState:
        """Return the state after the supply came on."""
        return ControllerState((block_of(make, words, assume), assume), COLD)

    return begin


def _displayed(make: Make, words: Words, _setpoint_degC: float | None, _units: Any) -> Mapping[str, EntryChange]:
    """Return each word as the instrument's display shows it; only its list of registers has the whole numbers."""
    texts = entry_texts({entry.name: display_text(entry, words.values) for entry in make.entries})
    return {entry.name: {**texts[entry.name], "format": "",
                         "meaning": f"{entry.description} [{entry.unit}]" if entry.unit else entry.description}
            for entry in make.entries}


def _most_power(make: Make) -> tuple[str, int] | None:
    entry = by_role(make, "high")
    return None if entry is None else (entry.name, 100 * 10**entry.decimals)


def _timer(make: Make) -> Timer:
    shortest, longest = make.sample_s
    return Timer(shortest_s=shortest, longest_s=longest, step_s=shortest)


def _instrument(name: str, make: Make) -> type[Controller]:
    """Return the class of a make, registered under its name."""
    timer = _timer(make)
    body: Mapping[str, Any] = {
        "__module__": __name__, "__doc__": f"{make.title}.", "title": make.title, "can": _CAN,
        "cannot": (*_CANNOT, *make.notes), "fields": tuple(map(field_of, make.entries)),
        "inputs": {"SP": "INT", "PV": "INT"}, "input_ranges": {"SP": (0, COUNTS), "PV": (0, COUNTS)},
        "counts": COUNTS, "timer": timer, "assumptions": PbandAssumptions,
        "derivative_filter": _USUAL_TV_S / (_USUAL_TV_S + 8.0 * min(max(timer.shortest_s, 0.25), timer.longest_s)),
        "cycle": Cycle(partial(period_of, make), partial(with_period, make),
                       tuple(period for _, period in periods_of(make)) or (period_of(make, {}),)),
        "most_power": _most_power(make),
        "core": StepFunctions(step=step, measure=count, flags=("upper limit", "lower limit")),
        "values": staticmethod(partial(values_of, make)), "design": staticmethod(partial(design_of, make)),
        "export": staticmethod(partial(export_words, name, make)), "text": staticmethod(partial(from_text, make)),
        "load_exported": staticmethod(partial(loaders, make)),
        "oddities": staticmethod(partial(oddities, make)), "consistent": staticmethod(partial(consistent, make)),
        "check_consistency": staticmethod(lambda _words: None), "begin": _begin(make),
        "keyed_entries": staticmethod(partial(_displayed, make)),
        "setpoint_entry": staticmethod(lambda _words, setpoint_degC, _units: f"{setpoint_degC:g} °C"),
        "main_file": f"{stem_of(name)}_sheet.txt",
    }
    return type(name.title().replace("-", ""), (Controller,), dict(body), name=name)


INSTRUMENTS: Final = tuple(_instrument(name, make) for name, make in MAKES.items())
