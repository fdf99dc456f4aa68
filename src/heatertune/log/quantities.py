"""Parse cells with a unit, a decimal comma, on or off, or no content.

Also the role and unit in a column name.

Join numbers whose decimal commas were taken for separators: 12,5,30,0 is 12.5 and 30.0 under two names.
"""

from __future__ import annotations

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from functools import partial
from itertools import accumulate, combinations, pairwise
from operator import itemgetter
from pathlib import Path
from typing import Final

import numpy as np

from heatertune.arrays import Array
from heatertune.errors import LogError
from heatertune.log.sheet import CellColumn, Grid
from heatertune.log.timestamps import stamp
from heatertune.units import count, degF_to_degC, kelvin_to_degC

__all__ = ["FORM_MARKS", "NOTHING", "ROLES", "demand_one_unit", "group_mark", "is_foreign", "is_heated",
           "is_in_celsius", "is_number", "is_quantity", "is_scaled", "is_second_choice", "is_switch_word",
           "join_decimals", "on_or_off", "plain_name", "plain_quantities", "role_of", "says_nothing", "signal_rank",
           "unit_in_name", "usual_form", "with_common_unit", "without_marks"]


ROLES: Final = ("time", "temperature", "power", "setpoint")

#: characters of a name that are looked at: a cell of a million would be searched for hours
_LONGEST: Final = 1000

#: looked for in this order: "set point (degC)" is no temperature, "heater temperature" no power; t is a time, T is not
_NAMES: Final[dict[str, re.Pattern[str]]] = {
    "setpoint": re.compile(
        r"(?i:set.?(point|temp|value)|temp\w* ?set\b|\bt?sp\d*\b|(target|working) ?sp\b|soll|target|consign[ea]"
        r"|设定|設定|목표|설정|уставк|заданн|zadan|žádan|börvärde|asetusarvo|ayar değeri|riferimento)"),
    "time": re.compile(
        r"(?i:time|zeit|\bdate|datum|elapsed|^milli|^sec|^minutes?$|^hours?$|^m?s$|^tage$|^days?$"
        r"|last.?(chang|updat)ed|^(tiempo|tempo|tijd|tid|czas|čas|zaman|aika|hora|heure|fecha|godzina|data)\b(?!\.\w)"
        r"|^(дата|время|час|idő|dátum|χρόνος|ώρα|ημερομηνία|זמן|เวลา|thời gian|oră)\b"
        r"|时间|日期|時刻|日時|時間|年月日|시간|날짜|^temps ?[\[(/] ?(s|sec|ms|min|h)\b)"
        r"|^(start[ _])?ts$|^t$|^[tT]s? ?[\[(/ ] ?(s|sec|[mnuµμ]s|min|h)\b"),
    "temperature": re.compile(
        r"(?i:(?<!pid )(?<!pid)temp|\bpv\d*\b|process.?va|istwert|\bist\b|actual(?!.*(power|output|out|duty|%))|°[cf]"
        r"|deg ?[cf]|kelvin|thermocouple|scaled.?input|\bpid ?(compact|temp|3step)[^.]*\.input$"
        r"|teplot|lämpötil|s[ıi]cakl[ıi]k|температур|温度|現在値|測定値|온도|hőmérs|θερμοκρ|טמפרט|nhiệt độ|อุณหภูมิ)"
        r"|^T\d*$|^[tT]\d* ?[\[(/ ] ?[KCF]\b|\bT\d*$"),
    "power": re.compile(
        r"(?i:power|duty|dimmer|heat(er|ing)|pwm|output|\bc[vo]\d*\b|\bop\d*\b|^[uq]\d*($|[ \[(/])|leistung"
        r"|^p\d* ?[\[(/] ?k?w\b|stell|heiz|volt|watt|spannung|strom|\bcurrent|\bamp(s|ere)?\b"
        r"|^control( signal| value)?$|manipulat|ausgang|\bactive ?out|\belement ?\d*\b"
        r"|relais|relay|\bssr\b|^heat$|heat ?(pct|percent|%)"
        r"|\bout\d*\b|puissance|pot[eê]nci?a|potenza|vermogen|^moc\b|výkon|мощност|нагрев|功率|出力"
        r"|输出|加热|加熱|操作量|ヒータ|effekt|^güç|çıkış|출력|히터|^teho\b|saída|salida|sortie|uscita|aquec|calefac|chauff|riscald|verwarm|grzał|topení|ohřev|ısıt"
        r"|värme\b|varme\b|pådrag|lämmit|fűt[eé]|teljesítm|θέρμανσ|ισχύ|потужн|нагрів|putere|încălz|הספק|חימום|กำลัง)"
        r"|\bMV\d*\b")}

#: what is heated: in a log with a named power, a column of its readings
_HEATED: Final = re.compile(
    r"(oven|furnace|kiln|chamber|zone|tank|boiler|bed|hot ?end|nozzle|barrel|platen|ofen|kammer|kessel|four|horno|forno"
    r"|piec|печь|炉)( ?#?\d{1,3})?", re.IGNORECASE)

#: used only if nothing else has the role: a room's temperature, a date next to the time of day, an electric current
_SECOND_CHOICE: Final = re.compile(
    r"(?i:ambient|room|\bext|outside|umgebung|raum|junction|board|cpu|^dat(e|um|a):?$|^fecha$|^data\b(?!\.\w)|volt|watt|spannung|strom|\bcurrent"
    r"|\bamp(s|ere)?\b|^control|last.?updated)")

#: after a unit of time in full: no second one follows, as in "hours, minutes and seconds"
_ALONE: Final = r"(?!.*\b(minutes|seconds|minuten|sekunden)\b)"

_UNITS: Final[dict[str, tuple[tuple[str, re.Pattern[str]], ...]]] = {
    "temperature": (
        ("degF", re.compile(r"°\s*f|deg\s*f|fahrenheit|[\[(/ ]f[\])]?$|temp(erature)?\d*f$")),
        ("K", re.compile(r"kelvin|[\[(/ ]k[\])]?$|temp(erature)?\d*k$")),
        ("degC", re.compile(r"°\s*c|deg\s*c|celsius|[\[(/ ]c[\])]?$|temp(erature)?\d*c$")),
    ),
    "time": (
        ("ms", re.compile(r"(^|[\[(/ ])m(illi)?s(ec(onds?)?)?\.?[\])]?$|^millis|[\[(]мс[\])]$")),
        ("min", re.compile(r"(^|[\[(/ ])min(ute[ns]?|s)?\.?[\])]?$|[\[(](мин|分)[\])]$")),
        ("h", re.compile(r"(^|[\[(/ ])(h(ours?|rs?)?|std|stunden)\.?[\])]?$")),
        ("d", re.compile(r"(^|[\[(/ ])(d|days?|tage)\.?[\])]?$")),
        ("s", re.compile(r"(^|[\[(/ ])s(e[ck](onds?|unden)?)?\.?[\])]?$|[\[(](с|сек|秒|초)[\])]$")),
        ("us", re.compile(r"(^|[\[(/ ])([uµμ]s(ec)?|micros(ec(onds?)?)?)\.?[\])]?$")),
        ("ns", re.compile(r"(^|[\[(/ ])n(ano)?s(ec(onds?)?)?\.?[\])]?$")),
        ("ms", re.compile(rf"\b(milliseconds|millisekunden)\b{_ALONE}")),
        ("min", re.compile(rf"\b(minutes|minuten)\b{_ALONE}")),
        ("h", re.compile(rf"\b(hours|stunden)\b{_ALONE}")),
        ("s", re.compile(rf"\b(seconds|sekunden)\b{_ALONE}")),
    ),
    "power": (
        ("27648", re.compile(r"\boutput per$")),  # Siemens: Output_PER of PID_Compact is an analogue output
        ("255", re.compile(r"255|8.?bit|pwm.*counts")),
        ("1", re.compile(r"0\s*(\.\.\.?|…|-|–|to)\s*1\b(?!00)|fraction|p\.?u\.?\b")),
        ("100", re.compile(r"main\.(active|working)out|\bpid ?(compact|temp)[^.]*\.output(heat|cool)?$"
                           r"|%|pct|percent|prozent|0\s*(\.\.\.?|…|-|–|to)\s*100\b")),
    )}

#: the range of a power in its name, of those that devices have: [0...127], (0-4095), [-255…255]
_FULL_SCALE: Final = re.compile(r"[\[(] *(?:0|-(?=(\d+)\D+\1 *[\])])\d+) *(?:\.\.\.?|…|–|-|to|bis) *"
                                r"(1|100|127|255|1000|1023|4095|10000|27648|32767|65535) *[\])]")
#: a column of a recorder whose name says nothing but its unit: CH0001 [C]
_IN_CELSIUS: Final = re.compile(r"[\[(] ?C ?[\])]$")
#: units that are neither a temperature, a time nor a share of full power
_FOREIGN: Final[dict[str, re.Pattern[str]]] = {
    "temperature": re.compile(r"%|pct|percent|counts?\b|\badc\b|[\[(/ ]m?[va][\])]?$|ohm|ω|\bbar\b"),
    "time": re.compile(r"[\[(/ ]ticks?[\])]?$"),
    "power": re.compile(r"[\[(/ 0-9][mk]?[wva](?:dc|ac)?[\])]?$|volt|watt|spannung|strom|\bcurrent|\bamp(s|ere)?\b"
                        r"|^control( signal| value)?$|counts?\b|\braw\b|\b[da][da]c\b|°|deg ?[cf]\b")}

#: a unit of time written as a capitalised end: timeMs, elapsedSeconds
_CAPITALISED: Final = re.compile(r"(?<=[a-z])(?=(Ms|Millis|Sec|Secs|Seconds|Min|Minutes|Hours)$)")
#: the numbers are a multiple of the unit: Temp_x10, PV [0.1 °C], time [10 ms]
_TIMES_TEN: Final = (r"(?<![a-z0-9])(x|×|\*) ?10+\b|(?<!\d)/ ?10+\b|(?<=[a-z])X10+\b"
                     r"|(?i:\bdeci(?!mal)|\bcenti(?!grad)|tenths?|zehntel|hundredths?)")
_SCALED: Final[dict[str, re.Pattern[str]]] = {
    "temperature": re.compile(rf"{_TIMES_TEN}|\b(0[.,]0?1|1/10+) ?(°|[dD]eg|[CFK]\b)|\b[cd]deg"),
    "time": re.compile(rf"{_TIMES_TEN}|\d ?(?i:[mnuµμ]?s|sec|min|h)\b"),
    "power": re.compile(rf"{_TIMES_TEN}|\b(0[.,]0?1|1/10+) ?%|‰|(?i:permil|promille)")}


def role_of(name: str) -> str | None:
    """Return the role denoted by a name, or None."""
    plain = plain_name(name)
    return next((role for role, pattern in _NAMES.items() if pattern.search(plain)), None)


def is_in_celsius(name: str) -> bool:
    """Return whether a name that denotes no role ends with the unit of a temperature, CH0001 [C]."""
    return role_of(name) is None and _IN_CELSIUS.search(plain_name(name)) is not None


def is_heated(name: str) -> bool:
    """Return whether a name is that of the thing that is heated: Zone 1, oven."""
    return _HEATED.fullmatch(plain_name(name)) is not None


def is_second_choice(name: str) -> bool:
    """Return whether a column is taken for its role only where nothing else has it."""
    return _SECOND_CHOICE.search(plain_name(name)) is not None


def unit_in_name(role: str, name: str) -> str | None:
    """Return the unit in a column's name, or None; for power its full scale."""
    lower = _CAPITALISED.sub(" ", plain_name(name)).lower()
    patterns = _UNITS.get("temperature" if role == "setpoint" else role, ())
    if role == "power" and (full := _FULL_SCALE.search(lower)) is not None:
        return full[2]
    units = (unit for unit, pattern in patterns if pattern.search(lower))
    return next(units, None)


def demand_one_unit(file: str, role: str, name: str, borne: str) -> None:
    """Refuse a column whose name and cells have different units.

    Args:
        file: its path.
        role: what the column holds.
        name: of the column, "" if it has none.
        borne: unit in its cells.

    Raises:
        LogError: the units differ.
    """
    header_unit, own = unit_in_name(role, name) if name else None, unit_in_name(role, f"[{borne}]")
    if header_unit is not None and own is not None and header_unit != own:
        option = {"power": "--power-full-scale", "time": "--time-unit"}.get(role, "--temperature-unit")
        raise LogError(f"a column named in {header_unit} whose cells are in", file=file, column=name, value=borne,
                       expected=f"one unit, or {option} {own} if the cells are right")


def is_foreign(role: str, name: str) -> bool:
    """Return whether a column's name contains a unit foreign to its role: power in watts, a PV in percent."""
    return unit_in_name(role, name) is None and _FOREIGN[role].search(plain_name(name).lower()) is not None


def signal_rank(name: str) -> int:
    """Return 0 for a power in W or a share, 1 for another signal, 2 for one in mV, as of a thermocouple."""
    unit = _SIGNAL.search(plain_name(name))
    return 0 if unit is None else 2 if unit[1] == "mV" else 1


_SIGNAL: Final = re.compile(r"[\[(/ ](m?[VA])[\])]?$")


def is_scaled(role: str, name: str) -> bool:
    """Return whether a column's name says that its numbers are a multiple of a unit: Temp_x10, time [10 ms]."""
    return _SCALED["temperature" if role == "setpoint" else role].search(plain_name(name)) is not None


#: characters of full width in names of Japanese and Chinese tools
_WIDE: Final = str.maketrans("％（）［］：／", "%()[]:/")


def plain_name(name: str) -> str:
    """Normalise a name: spaces for underscores, one notation for degrees, long names truncated."""
    plain = name[:_LONGEST].replace("_", " ").strip().translate(_WIDE)
    return plain.replace("º", "°").replace("℃", "°C").replace("℉", "°F")


_FIGURE: Final = r"[+-]?(?:\d+(?:[.,]\d*)?|[.,]\d+)(?:[eE][+-]?\d+)?"
#: other characters for those of a number: minus signs of typographers, digits of full width and Arabic ones
_FORMS: Final = str.maketrans("０１２３４５６７８９٠١٢٣٤٥٦٧٨٩۰۱۲۳۴۵۶۷۸۹−–－．，’٫٬\u00a0\u202f\u2009",
                              "012345678901234567890123456789---.,'.'   ")
#: marks of a cell that may hold a number or a time in another form: 1 007, 2.0D+01, 0x00CC, and those that always do; a
#: search that begins with a set of characters passes over all others ten times as fast
FORM_MARKS: Final = re.compile("['\"’=(\\[−–－０-９٠-٩۰-۹\u00a0\u202f\u2009 dDxX]"
    "(?:(?<=[^ dDxX])|(?<=\\d )\\d{3}|(?<=[+-] ) *[\\d.]|(?<=\\d[dD])[+-]?\\d|(?<=0[xX])[0-9a-fA-F])")
_WRAPPED: Final = re.compile(r"=?\"([^\"]*)\"|'([^']*)'?|\[([-\d./T:, ]+)\]")
_ACCOUNTANTS: Final = re.compile(r"\((\d[\d., ']*)\)")
_SPACED: Final = re.compile(r"([+-]?\d{1,3}(?:[ ']\d{3})+(?:[.,]\d+)?)( ?[^\d\s].*)?")
_SIGNED: Final = re.compile(r"([+-]) +(?=[\d.])")  # recorders align their signs: +  20.4
_HEXADECIMAL: Final = re.compile(r"0[xX][0-9a-fA-F]{1,8}")
_FORTRAN: Final = re.compile(r"([+-]?\d+\.?\d*)[dD]([+-]?\d+)")


def usual_form(cell: str) -> str:
    """Return a cell with its number or time as other files write it.

    Not ="20.5" as a spreadsheet keeps texts, '20.5', [10:00:00], (20.5) below zero, 1 007 and 1'007 in groups,
    2.0D+01, 0x00CC.
    """
    if FORM_MARKS.search(cell) is None:
        return cell
    wrapped = _WRAPPED.fullmatch(cell)
    text = (cell if wrapped is None else next(filter(None, wrapped.groups()), "")).translate(_FORMS).strip()
    text = text if _SIGNED.match(text) is None else _SIGNED.sub(r"\1", text, count=1)
    if match := _ACCOUNTANTS.fullmatch(text):
        text = f"-{match[1]}"
    if match := _SPACED.fullmatch(text):
        text = match[1].replace(" ", "").replace("'", "") + (match[2] or "")
    elif match := _FORTRAN.fullmatch(text):
        text = f"{match[1]}E{match[2]}"
    elif _HEXADECIMAL.fullmatch(text):
        text = str(int(text, 16))
    return text if wrapped is not None or is_number(text) or is_quantity(text) or stamp(text) is not None else cell


_GROUPED: Final = {mark: re.compile(rf"[+-]?[1-9]\d{{0,2}}(?:\{mark}\d{{3}})+(?:\{other}\d+)?( ?\D.*)?")
                   for mark, other in ((",", "."), (".", ","))}
_FAR: Final = 0.8  # of the largest step: a number that passes 1000 makes a large one where its groups are decimals
_GROUPS_TRIED: Final = 100  # cells
_FEW_GROUPED: Final = 0.05  # of the cells: a damaged one may look like a number in groups


def group_mark(cells: CellColumn, *, decimal_commas: bool | None = None) -> str:
    """Return the mark that groups the thousands of a column, "," or ".", or "" if that is not certain.

    Certain are a second group or decimals behind another mark; and, where some numbers have no mark, that they go on
    beyond 999 with groups, but jump with decimals.

    Args:
        cells: of the column.
        decimal_commas: whether the user says that its numbers have decimal commas; None: that is not known.
    """
    for mark, other in ((",", "."), (".", ",")):
        if not cells.holds(mark) or not all(
                _GROUPED[mark].fullmatch(cell) for cell in cells[:_GROUPS_TRIED] if mark in cell):
            continue
        written = [cell for cell in cells if not says_nothing(cell)]
        marked = [cell for cell in written if mark in cell]
        sure = any(cell.count(mark) > 1 or other in cell for cell in marked)
        if decimal_commas is None and not sure and len(marked) == len(written):
            continue  # three decimals, or thousands of which nothing shows that they are
        if not all(map(_GROUPED[mark].fullmatch, marked)):
            continue
        if decimal_commas is not None:
            return mark if decimal_commas == (mark == ".") else ""
        if (sure and len(marked) > _FEW_GROUPED * len(written)) or _goes_on(written, mark, other):
            return mark
    return ""


def _without_groups(cells: CellColumn, *, decimal_commas: bool | None = None) -> CellColumn | None:
    """Return cells without the marks that group their thousands, None if that is not certain; see `group_mark`."""
    mark = group_mark(cells, decimal_commas=decimal_commas)
    if not mark:
        return None
    return cells.map(lambda cell: cell.replace(mark, "") if _GROUPED[mark].fullmatch(cell) else cell)


def _goes_on(cells: Sequence[str], mark: str, decimal_mark: str) -> bool:
    """Return whether numbers without a mark, up to 999, and those with it follow each other as thousands."""
    like = re.compile(r"([+-]?[\d.,]+)" + re.escape(re.sub(r"[+-]?[\d.,]+", "", cells[0], count=1)))  # of one unit
    figures = [match[1] for cell in cells if (match := like.fullmatch(cell)) is not None]
    if len(figures) < len(cells) or not any(mark not in figure for figure in figures):
        return False
    try:
        grouped, decimal = (np.array([
            float(figure.replace(mark, between).replace(decimal_mark, ".")) for figure in figures])
            for between in ("", "."))
    except ValueError:
        return False
    return bool(_largest_step(grouped) <= _FAR * _largest_step(decimal))


def _largest_step(values: Array) -> float:
    """Return the largest step between two values as a share of their span; shape (n,)."""
    return float(np.max(np.abs(np.diff(values)), initial=0.0) / max(float(np.ptp(values)), 1e-12))


_NUMBER: Final = re.compile(rf"{_FIGURE}|[+-]?(?:nan|inf|infinity)", re.IGNORECASE)
_COMMA: Final = re.compile(r"[+-]?\d*,\d+([eE][+-]?\d+)?")
_POINT: Final = re.compile(r"[+-]?\d*\.\d+([eE][+-]?\d+)?")
_QUANTITY: Final = re.compile(
    rf"({_FIGURE})[ \u00a0\u202f]*(°[CFK]?|º[CF]|℃|℉|deg ?[CF]|[CFK]|Kelvin|%|pct|[mk]?[VAW]|Volts?|Watts?"
    r"|m?s|sec|min|h)", re.IGNORECASE)

#: cells that say that they hold nothing
NOTHING: Final = frozenset((
    "", "nan", "null", "none", "n/a", "na", "-", "--", "---", "unavailable", "unknown", "#n/a", "#nv", "no data",
    "undefined", "bad", "bad input", "i/o timeout", "comm fail", "#n/d", "#wert!", "#value!", "#valor!", "#div/0!", "#",
    "----", "-----", "--.-", "--.--", "---.-", "err", "erro", "error", "open", "+over", "-over", "over", "nan.", "s.br",
    "sbr", "nopv", "****", "-nan", "+nan", "nan(ind)", "-nan(ind)", "1.#qnan", "-1.#ind", "1.#inf",
))
_ON: Final = frozenset((
    "true", "on", "yes", "ja", "ein", "an", "wahr", "heating", "high", "active", "aktiv", "run", "running", "ligado",
    "marche", "encendido", "acceso", "aan", "вкл", "включено", "zał", "zapnuto", "på", "päällä", "açık", "オン", "开",
    "켜짐", "开启", "켬", "入", "t", "y", "vrai", "vero", "verdadero", "verdadeiro", "sí", "si", "sim", "oui", "waar",
    "prawda", "pravda", "истина", "да", "till", "til", "tændt", "be", "włączony", "włączona", "evet", "ναι", "ανοιχτό",
    "tosi", "igaz", "是"))
_OFF: Final = frozenset(("false", "off", "no", "nein", "aus", "falsch", "idle", "low", "inactive", "inaktiv", "stop",
    "stopped", "standby", "desligado", "arrêt", "apagado", "spento", "uit", "выкл", "выключено", "wył", "vypnuto", "av",
    "pois", "kapalı", "オフ", "关", "꺼짐", "关闭", "끔", "切", "f", "n", "faux", "falso", "não", "non", "onwaar",
    "fałsz", "nepravda", "ложь", "нет", "från", "fra", "slukket", "ki", "wyłączony", "wyłączona", "hayır", "όχι", "οχι",
    "κλειστό", "epätosi", "hamis", "否"))


def is_number(cell: str) -> bool:
    """Return whether a cell is a number, decimal comma or point."""
    return _NUMBER.fullmatch(cell.strip()) is not None


def is_quantity(cell: str) -> bool:
    """Return whether a cell is a number with a unit: 20.0 °C, 40%."""
    return _QUANTITY.fullmatch(cell) is not None


def says_nothing(cell: str) -> bool:
    """Return whether a cell is empty or says that it holds nothing."""
    return cell.lower() in NOTHING


def on_or_off(cells: CellColumn) -> Array | None:
    """Convert on/off cells (true, yes, ein …) to 1 and 0, shape (n,); None if one of them is neither."""
    if not all(cell.lower() in _ON | _OFF for cell in cells.kinds()):
        return None
    return cells.numbers(lambda cell: float(cell.lower() in _ON))


def is_switch_word(cell: str) -> bool:
    """Return whether a cell says on or off."""
    return cell.lower() in _ON | _OFF


def plain_quantities(cells: CellColumn, *, decimal_commas: bool | None = None,
                     lenient: bool = False) -> tuple[CellColumn, str, bool] | None:
    """Return plain numbers, the common unit, and whether there were decimal commas; None if nothing changes.

    A column with both commas and points of which neither is certain to group thousands is left unchanged; so is one
    with two units.

    Args:
        cells: of a column.
        decimal_commas: whether the user says that its numbers have decimal commas; None: that is not known.
        lenient: whether a few words among cells with a unit are damaged ones; in a long table they are another signal.
    """
    if (figures := _without_groups(cells, decimal_commas=decimal_commas)) is not None:
        return plain_quantities(figures, lenient=lenient) or (figures, "", False)
    first = next((cell for cell in cells if not says_nothing(cell)), "")
    if is_quantity(first) and (sized := _in_base_unit(cells)) is not None:
        return (*sized, False)
    if not is_quantity(first) and not cells.holds(","):
        return None
    unit = _common_unit(cells, lenient=lenient) if is_quantity(first) else ""

    def figure(cell: str) -> str:
        match = _QUANTITY.fullmatch(cell) if unit and not says_nothing(cell) else None
        return cell if match is None else match[1]

    commas = False
    for cell in map(figure, cells.kinds()):
        commas |= _COMMA.fullmatch(cell) is not None
        if _POINT.fullmatch(cell):
            commas = False
            break
    if not unit and not commas:
        return None

    def plain(cell: str) -> str:
        text = figure(cell)
        return text.replace(",", ".") if commas and _COMMA.fullmatch(text) else text

    return cells.map(plain), unit.strip("°º") and unit, commas


#: canonical unit → its notations, with the encodings that broke the sign of degrees
_NOTATIONS: Final = {
    "°C": re.compile(r"(°|º|Â°|\ufffd|\?|deg|grad)? ?C(elsius)?|℃", re.IGNORECASE),
    "°F": re.compile(r"(°|º|Â°|\ufffd|\?|deg|grad)? ?F(ahrenheit)?|℉", re.IGNORECASE),
    "K": re.compile(r"°?K(elvin)?", re.IGNORECASE), "%": re.compile(r"%|pct|percent|prozent", re.IGNORECASE)}
_WRITTEN: Final = re.compile(
    rf"({_FIGURE}|[-.#]+|err|nan|n/a|null)[ \u00a0\u202f]*[\[(]?([^\d\s.,:+\-\[()\]][^\d\[()\]]*)[\])]?", re.IGNORECASE)
_TO_CELSIUS: Final[dict[str, Callable[[float], float]]] = {
    "°C": lambda value: value, "°F": degF_to_degC, "K": kelvin_to_degC}
_GROUPED_QUANTITY: Final = re.compile(r"[+-]?\d{1,3}[.,]\d{3}[\d.,]* ?[^\d\s.,].*")
_LOOKED_AT: Final = 64  # cells, to see whether any bears a unit


def with_common_unit(cells: CellColumn, *, bare: bool,
                     decimal_commas: bool | None = None) -> tuple[CellColumn, str] | None:
    """Return cells whose unit is written in one way, and what was done; None if nothing is to be done.

    Several notations of a unit become one. Temperatures in several units become °C. A number without a unit has that
    of the others, if these have one.

    Args:
        cells: of a column.
        bare: whether numbers without a unit may be of the same quantity.
        decimal_commas: as of `group_mark`.
    """
    some = cells.at_rows(np.unique(np.linspace(0, len(cells) - 1, _LOOKED_AT).astype(np.intp)))
    if any(map(_GROUPED_QUANTITY.fullmatch, some)):
        cells = _without_groups(cells, decimal_commas=decimal_commas) or cells
    elif not any(map(itemgetter(1), map(_unit_of, some))):
        return None
    parts = {cell: _unit_of(cell) for cell in cells.kinds()}
    units = sorted({unit for _, unit in parts.values()} - {""})
    if len(units) > 1:
        return _converted(cells, parts, units)
    return _in_one_notation(cells, parts, units[0], bare=bare) if units else None


def _converted(cells: CellColumn, parts: Mapping[str, tuple[str, str]],
               units: Sequence[str]) -> tuple[CellColumn, str] | None:
    """Return temperatures of several units in °C; None of other units, or where numbers without one are among them."""
    if not _TO_CELSIUS.keys() >= {*units} or np.any(cells.where(_is_bare)):
        return None
    note = f"The cells of column {{}} are in {' and '.join(units)}; all were converted to °C."
    return cells.map(partial(_in_celsius, parts=parts)), note


def _in_one_notation(cells: CellColumn, parts: Mapping[str, tuple[str, str]], unit: str, *,
                     bare: bool) -> tuple[CellColumn, str] | None:
    without = int(np.count_nonzero(cells.where(_is_bare)))
    if without and (not bare or len(cells) - without < _TWO):
        return None
    common = cells.map(partial(_in_unit, parts=parts, unit=unit))
    if without:
        return common, f"{count(without, 'cell')} of column {{}} without a unit read in {unit}, as the others."
    return None if list(common.kinds()) == list(cells.kinds()) else (common, "")


def _is_bare(cell: str) -> bool:
    return is_number(cell) and not says_nothing(cell)


def _in_celsius(cell: str, parts: Mapping[str, tuple[str, str]]) -> str:
    figure, unit = parts[cell]
    if not unit or not any(map(str.isdigit, figure)):
        return figure or cell
    return f"{_TO_CELSIUS[unit](float(figure.replace(',', '.'))):.12g} °C"


def _in_unit(cell: str, parts: Mapping[str, tuple[str, str]], unit: str) -> str:
    figure, own = parts[cell]
    if not own and not _is_bare(cell):
        return cell
    return figure if says_nothing(figure) and own else f"{figure if own else cell} {unit}"


def _unit_of(cell: str) -> tuple[str, str]:
    """Return the figure of a cell and its unit in the usual notation, "" and "" if it bears no such unit."""
    match = _WRITTEN.fullmatch(cell)
    unit = next((unit for unit, notation in _NOTATIONS.items() if match and notation.fullmatch(match[2].strip())), "")
    return (match[1], unit) if match and unit else ("", "")


_MARKED: Final = re.compile(rf"({_FIGURE}) ?(?:[*!#?]|HH?|LL?)")
_MARK: Final = re.compile(r"[*!#?HL](?:(?<=\d.)|(?<=\d .))")


def without_marks(cells: CellColumn) -> CellColumn | None:
    """Return cells without the marks of limits behind some of their numbers, 52.1* and 20.4 L; None: there are none."""
    if not cells.matches(_MARK):
        return None
    kinds = [cell for cell in cells.kinds() if not says_nothing(cell)]
    marked = {cell: match[1] for cell in kinds if (match := _MARKED.fullmatch(cell)) is not None}
    if len(marked) == len(kinds) or not all(cell in marked or is_number(cell) for cell in kinds):
        return None
    return cells.map(lambda cell: marked.get(cell, cell))


#: unit → the one of its kind in which cells are read, and its size in that
_SIZES: Final = {"W": ("W", 1.0), "kW": ("W", 1e3), "V": ("V", 1.0), "mV": ("V", 1e-3), "A": ("A", 1.0),
                 "mA": ("A", 1e-3), "ms": ("s", 1e-3), "s": ("s", 1.0), "sec": ("s", 1.0), "min": ("s", 60.0),
                 "h": ("s", 3600.0)}


def _in_base_unit(cells: CellColumn) -> tuple[CellColumn, str] | None:
    """Return numbers in one unit of cells whose units differ in size alone, 850 W and 1.2 kW; None of other cells."""
    matches = {cell: _QUANTITY.fullmatch(cell) for cell in cells.kinds() if not says_nothing(cell)}
    units = {cell: "" if match is None else match[2] for cell, match in matches.items()}
    if len({*units.values()}) < _TWO or len({_SIZES.get(unit, (unit,))[0] for unit in units.values()}) > 1:
        return None

    def sized(cell: str) -> str:
        match = matches.get(cell)
        return cell if match is None else f"{float(match[1].replace(',', '.')) * _SIZES[match[2]][1]:.12g}"

    return cells.map(sized), _SIZES[next(iter(units.values()))][0]


_TWO: Final = 2


def _common_unit(cells: CellColumn, *, lenient: bool) -> str:
    """Return the unit of all cells that hold something, `lenient` but for a few words, "" where they differ."""
    matches = {cell: _QUANTITY.fullmatch(cell) for cell in cells.kinds() if not says_nothing(cell)}
    units = {match[2].strip() for match in matches.values() if match is not None}
    strange = {cell for cell, match in matches.items() if match is None}
    if len(units) != 1 or any(map(is_number, strange)) or (
            strange and np.count_nonzero(cells.where(strange.__contains__)) > lenient * _MOST_WORDS * len(cells)):
        return ""
    return units.pop()


_MOST_WORDS: Final = 0.1  # share of the cells


_WHOLE: Final = re.compile(r"[+-]?\d+|.*:\d\d")
_DIGITS: Final = re.compile(r"\d{1,6}")
_SAMPLE: Final = 400  # rows that are tried
_NEARLY_ALL: Final = 0.98
_CLEARLY: Final = 0.5  # of the roughness of the next best
_MOST_COLUMNS: Final = 12
_MANY: Final = 20  # values
_FIRST: Final = 5  # rows below the names


def join_decimals(file: Path, rows: Grid, stated: str | None, repairs: list[str]) -> None:
    """Join the two cells of each number with a decimal comma, in place, where there are more cells than names.

    Args:
        file: for messages.
        rows: of a file that separates its cells by commas, the names among the first.
        stated: columns with decimal commas, by number (1 = first) or name, with commas between them; "none"; None: find
            them.
        repairs: list to which the joining is added.

    Raises:
        LogError: several columns may be those with decimal commas, or one that is stated does not exist.
    """
    width = rows.width
    sample = [row for row in rows[-_SAMPLE:] if len(row) == width]
    words = [row for row in rows[:_SAMPLE] if 1 < len(row) < width and all(row) and not any(
        is_number(cell) or is_quantity(cell) or stamp(cell) is not None for cell in row)]
    names = max(words, key=lambda row: len({role_of(cell) for cell in row}), default=None)
    if names is None and any(len(row) == width and role_of(row[0]) for row in rows[:_SAMPLE]):
        return  # as many names as cells: the commas of numbers are quoted
    begins = 0 if names is None else next(k for k, row in enumerate(rows, start=1) if row == names)
    if stated is None and begins and all(len(row) == len(names or ()) for row in rows[begins:begins + _FIRST]):
        return  # as many cells as names at first: later rows have a column more
    if stated is not None:
        columns = () if stated == "none" else _stated(file, stated, names)
    elif names is None:
        _demand_no_fractions(file, sample)
        return
    elif width > 2 * len(names) or len(names) > _MOST_COLUMNS:
        return
    else:
        columns = _smoothest_join(file, sample, len(names), width)
    if not columns:
        return
    number = width - len(columns)
    rows.join(width, [place for i, place in zip(range(number), _places(number, columns), strict=True) if i in columns])
    shown = ", ".join(repr(names[i]) if names else str(i + 1) for i in columns)
    repairs.append(f"The decimal commas of {shown} also separate the cells; each two cells were joined.")


def _demand_no_fractions(file: Path, sample: Sequence[Sequence[str]]) -> None:
    """Refuse cells without names of which one looks like the digits behind a decimal comma: 05, 31, 90.

    Raises:
        LogError: there is one, behind whole numbers.
    """
    for place, (before, cells) in enumerate(pairwise(zip(*sample, strict=True)), start=1):
        is_fraction = len(set(map(len, cells))) == 1 and len(cells[0]) > 1 and len(set(cells)) > _MANY and any(
            cell[0] == "0" for cell in cells)
        if is_fraction and all(map(_DIGITS.fullmatch, cells)) and all(map(_WHOLE.fullmatch, before)):
            raise LogError(f"{cells[-1]!r} in cell {place + 1} looks like decimals behind a comma", file=file,
                           expected=f"--decimal-comma {place} if so (the number of the column, further ones behind "
                                    "commas), or --decimal-comma none")


def _stated(file: Path, stated: str, names: Sequence[str] | None) -> tuple[int, ...]:
    columns = []
    for text in map(str.strip, stated.split(",")):
        if names and text in names:
            columns.append(names.index(text))
        elif text.isdecimal() and int(text) >= 1:
            columns.append(int(text) - 1)
        else:
            raise LogError("no column of decimal commas", file=file, value=text,
                           expected=f"one of {', '.join(names)}" if names else "numbers, 1 = first")
    return tuple(sorted(columns))


def _smoothest_join(file: Path, sample: Sequence[Sequence[str]], count: int, width: int) -> tuple[int, ...]:
    """Return the columns whose joining makes the smoothest numbers, empty if none makes numbers."""
    rough = {}
    for columns in combinations(range(count), width - count):
        trial = [list(row) for row in sample]
        if _are_decimals(sample, count, columns):
            _join(trial, count, columns)
            rough[columns] = _roughness(trial)
    if not rough:
        return ()
    best, *others = sorted(rough, key=lambda columns: rough[columns])
    if others and rough[best] > _CLEARLY * rough[others[0]]:
        remedies = " or ".join("--decimal-comma " + ",".join(str(i + 1) for i in each) for each in (best, *others[:2]))
        raise LogError("commas both separate the cells and mark decimals", file=file,
                       expected=f"{remedies}; or a file with semicolons")
    return best


def _places(count: int, columns: Iterable[int]) -> list[int]:
    """Return the place of the first cell of each column."""
    joined = set(columns)
    return list(accumulate((2 if i in joined else 1 for i in range(count - 1)), initial=0))


def _are_decimals(sample: Sequence[Sequence[str]], count: int, columns: Sequence[int]) -> bool:
    """Return whether the cells of the columns are a whole number and digits, always as many."""
    places = _places(count, columns)
    for column in columns:
        place = places[column]
        good = [row for row in sample if _WHOLE.fullmatch(row[place]) and _DIGITS.fullmatch(row[place + 1])]
        if len(good) < _NEARLY_ALL * len(sample) or len({len(row[place + 1]) for row in good}) > 1:
            return False
    return True


def _join(rows: Iterable[list[str]], count: int, columns: Sequence[int]) -> None:
    for row in rows:
        for column, place in reversed(list(zip(range(count), _places(count, columns), strict=True))):
            if column in columns and place + 1 < len(row):
                row[place : place + 2] = [f"{row[place]}.{row[place + 1]}"]


def _roughness(rows: Sequence[Sequence[str]]) -> float:
    """Return how far the numbers of each column jump from row to row, as a fraction of their span, added up."""
    total = 0.0
    for cells in zip(*rows, strict=True):
        try:
            values = np.array(cells, dtype=np.float64)
        except ValueError:
            continue
        total += float(np.mean(np.abs(np.diff(values)))) / max(float(np.ptp(values)), 1e-12)
    return total
