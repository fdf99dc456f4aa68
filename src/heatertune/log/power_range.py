"""The power of a log in percent: its full scale, a live zero (4–20 mA, 1–5 V, 2–10 V), a cooler below 0."""

from __future__ import annotations

import re
from collections.abc import Iterable
from dataclasses import replace
from functools import partial
from typing import Final

import numpy as np
import numpy.typing as npt

from heatertune.arrays import Array
from heatertune.errors import LogError
from heatertune.log.columns import Columns, cell_error, choose_column, numbers
from heatertune.log.log_values import EXPLICIT, LogSignal
from heatertune.log.quantities import is_scaled, on_or_off, says_nothing
from heatertune.log.sheet import Sheet
from heatertune.settings import ReadSettings
from heatertune.units import count

__all__ = ["power_moves", "power_of", "with_one_unit", "with_switch"]


#: readings without power and at full power of signals with a live zero, and the unit of each
_LIVE_ZEROS: Final = ((4.0, 20.0, "ma"), (1.0, 5.0, "v"), (2.0, 10.0, "v"))
_UNIT: Final = re.compile(r"[\[(/ _0-9](m?[av])(?:dc|ac)?[\])]?$|\b(volt|spannung|strom|current|amp)", re.IGNORECASE)
_VOLTS: Final = ("v", "mv", "volt", "nung")
_TOLERANCE: Final = 0.015  # of the span: an output card's error, which is set to the end of its range
_REACHED: Final = 0.01  # of the span
_MILLIAMPERES: Final = (4.0, 20.0)
_MILLIAMPERE: Final = re.compile(r"[\[(/ _]ma[\])]?$", re.IGNORECASE)
_AT_REST: Final = 5  # readings
_STILL: Final = 0.05  # of the rise
_ROOM_DEGC: Final = (15.0, 30.0)
_COLDEST_ROOM_DEGC: Final = 10.0
#: share of full power: readings as far below 0 are the error of an analogue signal, not those of a cooler
_BELOW_ZERO: Final = 0.01
_TWO_WAY: Final = re.compile(
    r"cool|kühl|kuehl|refrig|kälte|pid.?output.?sum|pid.?temp|peltier|h.?bridge|vollbrücke", re.IGNORECASE)


def _is_two_way(name: str) -> bool:
    """Return whether a name says that the signal heats and cools."""
    return _TWO_WAY.search(name) is not None


def _live_zeros(name: str, values: Array) -> list[tuple[float, float]]:
    """Return the ranges with a live zero that a signal may have, the nearest first; values of shape (n,)."""
    unit = _UNIT.search(name)
    kind = "" if unit is None else "v" if (unit[1] or unit[2])[-4:].lower() in _VOLTS else "ma"
    fitting = [(low, high) for low, high, its in _LIVE_ZEROS
               if kind in ("", its) and not len(_outside_levels(values, (low, high)))]
    return sorted(fitting, key=lambda ends: abs(float(np.min(values)) - ends[0]) + abs(float(np.max(values)) - ends[1]))


def _begins_off(name: str, values: Array, temperature_degC: Array) -> bool:
    """Return whether a signal in mA begins at 4 mA without power: a live zero of 4…20 mA.

    Were it 0…20 mA, the heater would begin at rest under a fifth of its power, above its room by a fifth of what full
    power makes: by more than a room is colder than where the log begins.
    """
    if not _MILLIAMPERE.search(name) or _MILLIAMPERES not in _live_zeros(name, values):
        return False
    low, high = _MILLIAMPERES
    moves = np.flatnonzero(np.abs(values - low) > _REACHED * (high - low))
    first = temperature_degC[:moves[0] if len(moves) else 0]
    first = first[~np.isnan(first)]
    if len(first) < _AT_REST:
        return False
    begin_degC, rise_degC = float(np.median(first)), float(np.nanmax(temperature_degC) - np.median(first))
    below_degC = rise_degC * low / float(np.max(values) - low)
    in_room = _ROOM_DEGC[0] <= begin_degC <= _ROOM_DEGC[1] and float(np.ptp(first)) < _STILL * rise_degC
    return in_room and begin_degC - below_degC < _COLDEST_ROOM_DEGC


def _reaches_ends(values: Array, ends: tuple[float, float]) -> bool:
    """Return whether a signal, shape (n,), reaches both ends of a range: without a unit, that is more than chance."""
    low, high = ends
    return bool(max(abs(np.min(values) - low), abs(np.max(values) - high)) < _REACHED * (high - low))


def _outside_levels(values: Array, levels: tuple[float, float]) -> npt.NDArray[np.intp]:
    """Return the rows whose reading lies outside of the readings without power and at full power, shape (k,)."""
    share = _share(values, levels)
    return np.flatnonzero((share < -_TOLERANCE) | (share > 1.0 + _TOLERANCE))


def _percent_between(values: Array, levels: tuple[float, float]) -> Array:
    """Return the power by its readings without power and at full power, shape (n,) [0…100 %]."""
    return np.clip(100.0 * _share(values, levels), 0.0, 100.0)


def _share(values: Array, levels: tuple[float, float]) -> Array:
    low, high = levels
    return np.asarray((values - low) / (high - low))


_SWITCH: Final = re.compile(
    r"relay|relais|\bssr\b|switch|schalter|[_ ](on|ein|state|status|active|aktiv)$", re.IGNORECASE)
_PWM: Final = re.compile("pwm", re.IGNORECASE)
_PERCENT_FULL: Final = 100.0
_WATTS: Final = re.compile(r"(^|[\[(/ _0-9])k?W[\])]?$|watt", re.IGNORECASE)
_SHOWN_SCALES: Final = 3
_MOST_STEPS: Final = 5  # levels of a test by hand
_SMALL: Final = 12.0  # a power in percent that never exceeds this may be volts of 0…10 V or amperes
_EXPECTED: Final = "--power-full-scale with the reading at full power{}, or --power-column none"
#: readings at full power that devices have: PWM of 8 bits, converters of 10 and 12 bits, tenths and hundredths of
#: a percent, the analogue modules of an S7, 15 and 16 bits
_FULL_SCALES: Final = (255, 1000, 1023, 4095, 10000, 27648, 32767, 65535)


def _refuse_readings(sheet: Sheet, value: float | None, levels: tuple[float, float] | None) -> None:
    """Refuse stated readings of a power that was not logged."""
    if value is None and levels is None:
        return
    option = "--power-full-scale" if levels is None else "--power-levels"
    raise LogError(f"no column of the power, whose readings {option} states", file=sheet.file,
                   expected=f"--power-column with the column of the power, or the command without {option}")


def power_of(sheet: Sheet, columns: Columns, value: float | None, repairs: list[str], doubts: list[str], *,
             levels: tuple[float, float] | None = None, temperature_degC: Array,
             others: Iterable[str] = ()) -> LogSignal | None:
    """Return the power [%], below 0 that of a cooler; its unit is the reading at full power. None: it was not logged.

    Args:
        sheet: the cells.
        columns: which column is what.
        value: reading at full power, if stated by the user.
        repairs: list to which assumptions are added.
        doubts: list to which uncertain assumptions are added.
        levels: readings without power and at full power, if stated by the user.
        temperature_degC: of each row, NaN without a reading, shape (n,).
        others: options that state the units of other columns which nothing shows.

    Raises:
        LogError: a cell that is not a power, an unknown full scale, a power out of range; readings of a power that was
            not logged.
    """
    if "power" not in columns.index:
        _refuse_readings(sheet, value, levels)
        return None
    switched = on_or_off(sheet.columns[columns.index["power"]])
    if switched is not None:
        repairs.append("The power is on or off; taken as 100 % and 0 %.")
        return LogSignal(switched * 100.0, "1", "on/off")
    expected = ("a number, or on and off in every row (--power-on with the cell that means on; --power-column none if "
                "there is no power)")
    values = numbers(sheet, columns, "power", expected)
    if levels is not None:
        return _between(sheet, columns, values, levels, repairs)
    if value is None and _begins_off(columns.units.get("power", columns.names["power"]), values, temperature_degC):
        repairs.append("The power is a signal of 4…20 mA: the log begins at 4 mA with a heater at room temperature.")
        return LogSignal(_percent_between(values, _MILLIAMPERES), repr(20.0), "4…20", "off at 4 mA in a room",
                         levels=_MILLIAMPERES)
    highest = float(np.max(np.abs(values)))
    label = None if is_scaled("power", columns.names["power"]) else columns.unit("power")
    if label == "27648" and highest <= _PERCENT_FULL:
        label = None  # a column of that name that was converted
    if label == "100" and "power" not in columns.units and 0.0 < highest <= 1.0:
        label = None  # a column named in percent that holds shares, as a spreadsheet exports it
    full_scale = value or (float(label) if label else _assumed(sheet, columns, values, repairs, doubts, others))
    if full_scale != 100.0:
        repairs.append(f"The power was divided by its reading at full power, {full_scale:g}.")
    values = _two_way(sheet, columns, values, full_scale, repairs)
    two_way = bool(np.any(values < 0.0))
    evidence, sign = EXPLICIT, " %" if full_scale == 100.0 else ""
    shown = f"{-full_scale if two_way else 0:g}…{full_scale:g}{sign}"
    percent = values if full_scale == 100.0 else values / full_scale * 100.0
    if two_way:
        evidence = EXPLICIT if value or _is_two_way(columns.names["power"]) else ""
        shown += ", it cools below 0" + (
            "" if evidence else f" (off at {-full_scale:g}: --power-levels {-full_scale:g} {full_scale:g})")
    elif not (value or label):
        evidence = _evidence(columns.names["power"], values, full_scale)
    likely = "255" if _PWM.search(columns.names["power"]) else "100"
    return LogSignal(percent, repr(full_scale), shown, evidence, likely)


def _between(sheet: Sheet, columns: Columns, values: Array, levels: tuple[float, float],
             repairs: list[str]) -> LogSignal:
    """Return the power by its readings without power and at full power, as the user states them."""
    off, full = levels
    if off == full:
        raise LogError("one reading for no power and for full power", file=sheet.file, value=f"{off:g}",
                       expected="--power-levels with two different readings, such as 4 20")
    if len(outside := _outside_levels(values, levels)):
        raise cell_error(sheet, columns, "power", int(outside[0]), "power out of range:",
                         f"{min(levels):g}…{max(levels):g}, as --power-levels says")
    repairs.append(f"The power is 0 % at a reading of {off:g} and 100 % at {full:g}, as stated.")
    return LogSignal(_percent_between(values, levels), repr(full), f"{off:g}…{full:g}", levels=levels)


def _two_way(sheet: Sheet, columns: Columns, values: Array, full_scale: float, repairs: list[str]) -> Array:
    """Return the readings of a power, those just below 0 as 0; those farther below are a cooler's.

    Raises:
        LogError: a reading beyond full power, either way, or a power that never heats.
    """
    lowest, highest = float(np.min(values)), float(np.max(values))
    outside = np.flatnonzero(np.abs(values) > full_scale)
    if len(outside):
        other = f"(--power-full-scale tells another reading at full power{_offset(columns.names['power'], values)})"
        raise cell_error(sheet, columns, "power", int(outside[0]), "power out of range:",
                         f"{-full_scale if lowest < 0.0 else 0:g}…{full_scale:g} {other}")
    if lowest >= 0.0:
        return values
    if lowest >= -_BELOW_ZERO * full_scale:
        repairs.append(f"{count(int(np.sum(values < 0.0)), 'reading')} of the power down to {lowest:g}, just below 0, "
                       "taken as 0.")
        return np.maximum(values, 0.0)
    if highest <= 0.0:
        raise LogError(f"a power from {lowest:g} up to {highest:g}, which never heats", file=sheet.file,
                       column=columns.names["power"],
                       expected=f"--power-levels 0 {-full_scale:g} and --cooler for a cooler that is off at 0, or "
                                f"--power-levels {-full_scale:g} 0 for a heater that is off at {-full_scale:g}")
    repairs.append(f"The power goes down to {lowest:g}; taken as a heater's above 0 and a cooler's below (a heater "
                   f"that is off at {-full_scale:g}: --power-levels {-full_scale:g} {full_scale:g}).")
    return values


def _offset(name: str, values: Array) -> str:
    """Return the option that states a live zero, for a message, if the readings may have one."""
    return "".join(f"; --power-levels {low:g} {high:g} for {low:g} without power" for low, high in _live_zeros(
        name, values)[:1])


def _evidence(name: str, values: Array, full_scale: float) -> str:
    """Return the evidence for the full scale of a power without a unit: on/off values, its extremes, or none.

    A name that suggests counts or multiples, such as PWM or x10, contradicts the extremes. They are none of a few steps
    either, which may go to 100 counts of 255: a controller that is limited there has many levels or switches often.
    """
    if full_scale == 1.0:
        return "of a switch"
    controlled = len(np.unique(values)) > _MOST_STEPS or np.count_nonzero(np.diff(values)) > 2 * _MOST_STEPS
    reached = controlled and (float(values.min()), float(values.max())) == (0.0, full_scale)
    contradicted = full_scale not in _COUNTS and (_PWM.search(name) or is_scaled("power", name))
    return "both reached" if reached and not contradicted else ""


#: those of `_FULL_SCALES` at which nobody would limit another range, and no power in watts ends by chance
_COUNTS: Final = (255, 1023, 4095, 27648, 32767, 65535)


def _assumed(sheet: Sheet, columns: Columns, values: Array, repairs: list[str], doubts: list[str],
             others: Iterable[str]) -> float:
    """Return 100 if the numbers can only be percent, 1 for on/off values; the user has to state anything else."""
    name, largest = columns.names["power"], float(np.max(np.abs(values)))
    if _SWITCH.search(name) and set(np.unique(values)) <= {0.0, 1.0}:
        repairs.append("The power is 0 or 1 of a switch; taken as off and on.")
        return 1.0
    why = next((why for holds, why in (
        (columns.is_foreign("power"), "in a unit that is not a share of full power"),
        (largest > 100.0, "is no percentage"),
        (0.0 < largest <= 1.0, "may be a fraction or percent"),
        (_PWM.search(name) is not None and not np.any(values % 1.0), "may be percent or counts of 255"),
    ) if holds), None)
    unit = columns.units.get("power", name)
    if largest in _COUNTS and _evidence(name, values, largest) and not (_UNIT.search(unit) or _WATTS.search(unit)):
        repairs.append(f"The power has no unit in the file; taken as counts of {largest:g}, as it is limited to 0 and "
                       "to that.")
        return largest
    zeros = _live_zeros(unit, values)
    if zeros and (why is None or columns.is_foreign("power")) and (columns.is_foreign("power") or _reaches_ends(
            values, zeros[0])):
        remedies = " or ".join(f"--power-levels {low:g} {high:g}" for low, high in zeros)
        raise LogError(f"a power from {float(np.min(values)):g} to {largest:g} {why or 'may be percent'}, or a "
                       "signal with a live zero", file=sheet.file, column=name,
                       expected=f"{remedies} for such a signal, --power-full-scale with the reading at full power if "
                                "it is 0 without power, or --power-column none")
    if why:
        is_in_watts = _WATTS.search(unit) is not None
        likely = [scale for scale in _FULL_SCALES if largest <= scale][:_SHOWN_SCALES] if (
            largest > 100.0 and not is_in_watts) else []
        perhaps = f" ({' or '.join(map(str, likely))}?)" if likely else ""
        raise LogError(f"a power up to {largest:g} {why}", file=sheet.file, column=name,
                       expected=_EXPECTED.format(perhaps) + "".join(f"; and {option} if so" for option in others))
    repairs.append("The power has no unit in the file; taken as percent (otherwise: --power-full-scale).")
    if 0.0 < largest <= _SMALL:
        doubts.append(f"The power, taken as percent, never exceeds {largest:g} %: were it volts or amperes, "
                      "--power-full-scale would have to tell the reading at full power.")
    return 100.0


_SHARE_OR_OTHER: Final = re.compile(r"(.*\d) ?(%|k?W|m?V)")
_SIZES: Final = {"W": 1.0, "kW": 1e3, "V": 1.0, "mV": 1e-3}


def with_one_unit(sheet: Sheet, columns: Columns, full_scale: float | None) -> tuple[Sheet, Columns]:
    """Return a power of which some cells are in percent and the others in W or V in that unit alone.

    Args:
        sheet: the cells.
        columns: which column is what.
        full_scale: power or voltage of 100 %, if stated by the user [W or V].

    Raises:
        LogError: there are such cells, and it is not stated.
    """
    place = columns.index.get("power")
    if place is None or columns.units.get("power") or not sheet.columns[place].holds("%"):
        return sheet, columns
    cells = sheet.columns[place]
    kinds = [_SHARE_OR_OTHER.fullmatch(cell) for cell in cells.kinds() if not says_nothing(cell)]
    others = {match[2][-1] if match else "" for match in kinds} - {"%"}
    if len(others) != 1 or "" in others:
        return sheet, columns
    unit = others.pop()
    if full_scale is None:
        row = int(np.flatnonzero(cells.where(lambda cell: cell.endswith(unit)))[0])
        raise cell_error(sheet, columns, "power", row, f"some cells are in %, others in {unit}:",
                         f"--power-full-scale with the reading in {unit} at 100 %, or --power-column none")

    note = f"The cells of the power in % and in {unit} were read with 100 % at {full_scale:g} {unit}, as stated."
    sheet = sheet.with_column(place, cells.map(partial(_in_unit, full_scale=full_scale)))
    return replace(sheet, repairs=(*sheet.repairs, note)), replace(columns, units={**columns.units, "power": unit})


def _in_unit(cell: str, full_scale: float) -> str:
    """Return the number of a cell in W or V, of one in % by that at 100 %."""
    match = _SHARE_OR_OTHER.fullmatch(cell)
    if match is None:
        return cell
    return f"{float(match[1].replace(',', '.')) * {'%': full_scale / 100.0, **_SIZES}[match[2]]:.12g}"


def with_switch(sheet: Sheet, settings: ReadSettings) -> tuple[Sheet, ReadSettings]:
    """Return the sheet with on and off in the column of the power whose word for on is stated.

    Raises:
        LogError: no column holds the word, or several do.
    """
    word = settings.power_on
    if word is None:
        return sheet, settings
    columns = range(len(sheet.columns)) if settings.power_column is None else [
        choose_column(sheet, "power", settings.power_column)]
    places = [i for i in columns if sheet.columns[i].where(word.__eq__).any()]
    if len(places) != 1:
        raise LogError(f"{'several columns hold' if places else 'no column holds'} the word for on", file=sheet.file,
                       value=word, expected="--power-on with a cell of one column, and --power-column")
    column = sheet.columns[places[0]]
    unknown = {cell for cell in column.kinds() if cell != word and says_nothing(cell)}
    if len({*column.kinds()} - unknown) == 1:  # "ON" and blank, "closed" and "open": these are its other state
        unknown = set()
    cells = column.map(lambda cell: "on" if cell == word else cell if cell in unknown else "off")
    note = f"The power is on where its cell is {word!r}, as stated, and off elsewhere."
    return replace(sheet.with_column(places[0], cells), repairs=(*sheet.repairs, note)), replace(
        settings, power_column=str(places[0] + 1))


_MOVES: Final = 0.1  # of the power's range


def power_moves(sheet: Sheet, columns: Columns) -> npt.NDArray[np.bool_] | None:
    """Return in which rows the power moves by more than a tenth of its range, shape (n,); None if it is not logged."""
    if "power" not in columns.index:
        return None
    cells = sheet.columns[columns.index["power"]]
    switched = on_or_off(cells)
    values = cells.floats() if switched is None else switched
    if values is None:
        return None
    return np.abs(np.diff(values, prepend=values[:1])) > _MOVES * float(np.ptp(values))
