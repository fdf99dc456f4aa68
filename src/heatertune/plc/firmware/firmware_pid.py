"""A PID in firmware or a library as a row: what it is, its words, its law, its text; and the controller made of it.

    gain_1 = K·full/100        gain_2 = gain_1/TN        gain_3 = gain_1·TV

The three gains come first in the row, then the settings that no design changes; one word may hold the interval. See
`heatertune.plc.esphome.controller` for a whole one: the words, the law's parameters, the text both ways, and the row.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass, field
from functools import partial
from typing import Any, Final, NamedTuple

from heatertune.errors import NotRepresentable, OutOfRange
from heatertune.pid.design_values import PidDesign, Timer, structure_of
from heatertune.plc.controller import Controller
from heatertune.plc.core import ControllerState, StepFunctions
from heatertune.plc.exported import Loads, TextSettings
from heatertune.plc.firmware.firmware_text import decimal
from heatertune.plc.keyed_entry import entry_texts
from heatertune.plc.open_points import NothingOpen
from heatertune.plc.ramp import Number
from heatertune.plc.readback import ReadBack
from heatertune.plc.words import Certificate, Scaling, WordField, Words, round_to_word

__all__ = ["FirmwarePid", "controller_of", "gain_fields", "texts_of"]

#: largest gain that is taken as one, in the controller's units
_MOST_GAIN: Final = 1e9

Values = Mapping[str, Number]
Attributes = Mapping[str, Any]


@dataclass(frozen=True, slots=True, kw_only=True)
class FirmwarePid:
    """One firmware or library; attributes that are not explained here are those of `Controller`.

    Attributes:
        gains: the words of the three gains, see `gain_fields`.
        settings: the other words, in the order in which they are typed in.
        full: output at 100 % power.
        usual: value of each setting in a new design.
        interval: name of the word that holds the sampling interval, and its unit [s]; None: it is the timer's.
        method: of the design that words run.
        lag: values → weight of its own past in the derivative part.
        full_word: name of the word that holds that output; "": there is none.
        measurement: (name, value) of the word that puts P on the measurement, which is no standard form.
        law, cold: the step and its first state.
        parameters: (values, assumptions) → what the step takes first.
        text: reads the words in a text.
        settings_in: file of the export → what reads its settings.
        oddities: values → what is odd about the settings, one sentence each.
        check: as `Controller.consistent`.
        further: other attributes of `Controller`.
    """

    name: str
    title: str
    main_file: str
    can: tuple[str, ...]
    cannot: tuple[str, ...]
    inputs: Mapping[str, str]
    counts: int
    timer: Timer
    gains: tuple[WordField, WordField, WordField]
    settings: tuple[WordField, ...]
    full: float
    usual: Mapping[str, Number]
    interval: tuple[str, float] | None = None
    method: str
    lag: Callable[[Values], float] = lambda _values: 0.0
    full_word: str = ""
    measurement: tuple[str, int] | None = None
    law: StepFunctions
    cold: NamedTuple
    assumptions: type[NamedTuple] = NothingOpen
    parameters: Callable[[Values, Any], Any]
    export: Callable[[Words, Certificate], Mapping[str, str | bytes]]
    text: Callable[..., ReadBack]
    settings_in: Mapping[str, Callable[[str], TextSettings]]
    oddities: Callable[[Values], Iterable[str]]
    check: Callable[[Values], None] | None = None
    further: Attributes = field(default_factory=dict)

    @property
    def fields(self) -> tuple[WordField, ...]:
        """All words."""
        return (*self.gains, *self.settings)


def gain_fields(
    names: tuple[str, str, str], address: str, format_: str, comments: tuple[str, str, str]
) -> tuple[WordField, WordField, WordField]:
    """Return the words of three gains, none of them negative; an address may have the last letter of the name as {}."""
    kp, ki, kd = (WordField(name=name, address=address.format(name[-1].upper()), format=format_, low=0.0,
                            high=_MOST_GAIN, comment=comment) for name, comment in zip(names, comments, strict=True))
    return kp, ki, kd


def texts_of(words: Words, fields: Iterable[WordField]) -> dict[str, str]:
    """Return each word as the exported text has it."""
    return {each.name: _text(each, words.values[each.name]) for each in fields}


def _text(of: WordField, value: Number) -> str:
    if of.places is not None:
        return f"{value:.{of.places}f}"
    return decimal(value, of.format) if of.format in ("REAL", "LREAL") else str(value)


def _values(make: FirmwarePid, design: PidDesign, _scaling: Scaling) -> dict[str, Number]:
    """Return the words of a design of a heater.

    Raises:
        NotRepresentable: a cooler, whose gain is negative; a gain out of its range or rounded to zero.
    """
    gain, tn = design.gain_pct_per_degC, design.integral_time_s
    if gain < 0.0:
        raise NotRepresentable("gain", gain, "positive: these words are of a heater",
                               "a target whose words have a sign or a direction would fit")
    kp = gain * make.full / 100.0
    exact = (kp, 0.0 if math.isinf(tn) else kp / tn, kp * design.derivative_time_s)
    remedy = () if make.gains[0].places is None else ("a design of a faster heater would fit",)
    gains = {each.name: round_to_word(each, value, *remedy) for each, value in zip(make.gains, exact, strict=True)}
    interval_word = {} if make.interval is None else {make.interval[0]: round(design.sample_time_s / make.interval[1])}
    return {**gains, **make.usual, **interval_word}


def _design(make: FirmwarePid, words: Words) -> PidDesign | None:
    """Return the design that words run; None with P on the measurement, which is no standard form.

    Raises:
        OutOfRange: no P part, or gains so far apart that TN or TV is none; they have no standard form.
    """
    values = words.values
    if make.measurement is not None and values[make.measurement[0]] == make.measurement[1]:
        return None
    full = float(values[make.full_word]) if make.full_word else make.full
    gain, tn, tv = _standard_form(make, values, full)
    return PidDesign(
        gain_pct_per_degC=gain, integral_time_s=tn, derivative_time_s=tv, sample_time_s=words.sample_time_s,
        structure=structure_of(tn, tv), method=make.method, derivative_filter=make.lag(values))


def _standard_form(make: FirmwarePid, values: Values, full: float) -> tuple[float, float, float]:
    """Return K [%/°C], TN and TV [s]; errors as `_design`."""
    word = f"word {make.gains[0].name}"
    kp, ki, kd = (float(values[each.name]) for each in make.gains)
    if kp == 0.0:
        raise OutOfRange(word, kp, "not 0: the standard form needs a P part")
    tn, tv, gain = math.inf if ki == 0.0 else kp / ki, kd / kp, 100.0 * kp / full
    if 0.0 in (tn, gain) or math.inf in (tv, 0.0 if ki == 0.0 else tn):
        raise OutOfRange(word, kp, f"of the size of Ki = {ki:g} and Kd = {kd:g}")
    return gain, tn, tv


def _interval_s(make: FirmwarePid, values: Values) -> float:
    """Return the sampling interval that the words hold [s]."""
    if make.interval is None:
        return make.timer.shortest_s
    name, unit_s = make.interval
    return round(values[name] * unit_s, 6)


def _oddities(make: FirmwarePid, words: Words) -> tuple[str, ...]:
    """Return the oddities of the words of a running firmware, one sentence each."""
    (kp, ki, _), values = (each.name for each in make.gains), words.values
    remarks = [f"{kp} is 0: there is no proportional part."] if values[kp] == 0.0 else []
    if values[ki] == 0.0:
        remarks.append(f"{ki} is 0: there is no integral part, and an offset remains.")
    return (*remarks, *make.oddities(values))


def _begin(make: FirmwarePid, _self: Controller, words: Words, assume: Any) -> ControllerState:
    """Return the state after power-on."""
    parameters = make.parameters(words.values, assume)
    if words.boost is not None:
        parameters = parameters._replace(within=words.boost.within_degC, far=words.boost.again_degC)
    return ControllerState(parameters, make.cold)


def _entries(make: FirmwarePid, words: Words, _setpoint_degC: float | None, _units: Any) -> Mapping[str, Attributes]:
    """Return each word as the exported files have it, see `heatertune.plc.keyed_entry.KeyedEntry`."""
    return entry_texts(texts_of(words, make.fields))


def _loads(make: FirmwarePid, files: Mapping[str, str | bytes], _assume: Any) -> Loads:
    """Return the functions that read the settings in each file."""
    return {name: partial(settings, str(files[name])) for name, settings in make.settings_in.items()}


def _checked(check: Callable[[Values], None], words: Words) -> None:
    """Refuse words that contradict one another."""
    check(words.values)


def controller_of(make: FirmwarePid) -> type[Controller]:
    """Return the controller of a row, registered under its name."""
    body: Attributes = {
        "__module__": f"heatertune.plc.{make.name.replace('-', '_')}.controller", "__doc__": f"{make.title}.",
        "core": make.law, "keyed_entries": staticmethod(partial(_entries, make)),
        "values": staticmethod(partial(_values, make)), "design": staticmethod(partial(_design, make)),
        "interval_s": staticmethod(partial(_interval_s, make)), "oddities": staticmethod(partial(_oddities, make)),
        "load_exported": staticmethod(partial(_loads, make)), "derivative_filter": make.lag(make.usual),
        "consistent": None if make.check is None else staticmethod(partial(_checked, make.check)),
        "export": staticmethod(make.export), "text": staticmethod(make.text),
        "begin": lambda self, words, assume: _begin(make, self, words, assume),
    }
    same = ("title", "main_file", "can", "cannot", "fields", "inputs", "counts", "timer", "assumptions")
    body = {**body, **{name: getattr(make, name) for name in same}, **make.further}
    return type(make.name.title().replace("-", ""), (Controller,), dict(body), name=make.name)
