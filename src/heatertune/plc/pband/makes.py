"""The table of makes: where each parameter stands, in which digits, and what of it was read in a manual."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Final, NamedTuple

from heatertune.plc.words import FORMATS, WordField

__all__ = ["MAKES", "OFF_7201", "TIME_UNIT", "Entry", "Make", "field_of"]

#: Ti of ABB's instruments that means none [s]
OFF_7201: Final = 7201
#: word of Omron's that tells the unit of both times: 0: 1 s, 1: 0.1 s
TIME_UNIT: Final = "TIMEUNIT"


class Entry(NamedTuple):
    """One parameter.

    Attributes:
        name: of the word, as the display or the manual writes it.
        role: what it is to the law, see `heatertune.plc.pband.words`.
        address: of the register, or a mnemonic.
        low, high: of the number as it is written.
        decimals: places of the number as it is written; of a REAL: those that are typed in.
        unit: of the value.
        what: it is, in a few words.
        fixed: the number that is always written; None: it follows from design or period.
        real: whether it is a float of two registers.
        read: whether address and range were read in the manual that the make names.
    """

    name: str
    role: str
    address: str
    low: float
    high: float
    decimals: int
    unit: str
    description: str
    fixed: int | None = None
    real: bool = False
    read: bool = True


class Make(NamedTuple):
    """One make of instruments.

    Attributes:
        title: make, type and manual.
        sample_s: at which the proof samples [s], shortest and longest: of the generic one the user tells it; longer
            than the instrument's own, it is later than that.
        sampling: where that was read.
        menu: how its display is gone through, in the order of `entries`.
        entries: in the order of that menu.
        codes: number of the cycle time → seconds, where it is a code.
        period_s: of its pulses where none of its parameters is a period [s].
        decimal: whether addresses are written as decimal numbers in its manual.
        notes: what its user must know, one sentence each.
    """

    title: str
    sample_s: tuple[float, float]
    sampling: str
    menu: str
    entries: tuple[Entry, ...]
    codes: Mapping[int, float] = {}
    period_s: float | None = None
    decimal: bool = False
    notes: tuple[str, ...] = ()


def field_of(entry: Entry) -> WordField:
    """Return the word of a parameter."""
    places = f", {entry.decimals} decimal place{'s' if entry.decimals > 1 else ''}" if entry.decimals else ""
    unit = f" [{entry.unit}]" if entry.unit else ""
    format_ = "REAL" if entry.real else "INT"
    low, high = max(entry.low, FORMATS[format_][0]), min(entry.high, FORMATS[format_][1])
    return WordField(name=entry.name, address=entry.address, format=format_, low=low, high=high,
                     comment=f"{entry.description}{unit}{'' if entry.real else places}")


def _unread(*entries: Entry) -> tuple[Entry, ...]:
    """Return entries whose addresses or ranges were not read in a manual."""
    return tuple(entry._replace(read=False) for entry in entries)


_GENERIC: Final = Make(
    title="panel instrument with a proportional band in °C, Ti and Td in s (no one make's; see its own manual)",
    sample_s=(0.05, 10.0), sampling="as you tell it with --sample-time",
    menu="in the order in which most instruments show them",
    entries=_unread(
        Entry("Pb", "band", "Pb", 1, 9999, 1, "°C", "proportional band"),
        Entry("ti", "ti", "ti", 0, 9999, 0, "s", "integral time, 0: none"),
        Entry("td", "td", "td", 0, 9999, 0, "s", "derivative time, 0: none"),
        Entry("CYC", "cycle", "CYC", 1, 9999, 1, "s", "cycle time of the pulses"),
        Entry("OPH", "high", "OPH", 1, 1000, 1, "%", "upper limit of the output"),
    ),
    notes=("the addresses are those of your instrument's manual: none is known here",),
)

_OMRON: Final = Make(
    title="Omron E5CC (communications manuals H175, H186)",
    sample_s=(0.05, 0.25), sampling="the instrument samples every 50 ms, not read in the pages that were at hand",
    menu="initial setting level: CP; advanced function setting level: unit of the times, α, band; adjustment level: "
         "P, I, D, limits of MV",
    entries=(
        Entry("CP", "cycle", "2708H", -2, 99, 0, "s", "control period (heating); -2: 0.1 s, -1: 0.2 s, 0: 0.5 s"),
        Entry(TIME_UNIT, "unit", "3309H", 0, 1, 0, "", "integral/derivative time unit; 0: 1 s, 1: 0.1 s", read=False),
        Entry("ALFA", "alpha", "330AH", 0, 100, 2, "", "α of the 2-PID setpoint filter", 65, read=False),
        Entry("ORBAND", "least", "2D19H", 0, 500, 1, "%", "minimum output on/off band", 0),
        Entry("P", "band", "2A00H", 1, 9999, 1, "°C", "proportional band"),
        Entry("I", "ti", "2A01H", 0, 9999, 0, "s", "integral time, 0: none; the register counts the unit"),
        Entry("D", "td", "2A02H", 0, 9999, 0, "s", "derivative time, 0: none; in the same unit"),
        Entry("OL-H", "high", "2A05H", 1, 1000, 1, "%", "MV upper limit"),
        Entry("OL-L", "fixed", "2A06H", 0, 0, 1, "%", "MV lower limit", 0),
    ),
    codes={-2: 0.1, -1: 0.2, 0: 0.5},
    notes=(
        "addresses are those of the two-byte mode; PID ON/OFF must be 2-PID control, ST (self-tuning) OFF: it would "
        "overwrite P, I and D",
        "3309H and 330AH were read in H186 (E5CC-T) alone: check them in the manual of your type",
    ),
)

_EUROTHERM: Final = Make(
    title="Eurotherm 3200 series (HA028651)",
    sample_s=(0.25, 0.25), sampling="250 ms, not read in the pages that were at hand",
    menu="control list at level 3",
    entries=_unread(
        Entry("PB", "band%", "6", 1, 9999, 1, "% of the span", "proportional band"),
        Entry("Ti", "ti", "8", 0, 9999, 0, "s", "integral time, 0: none"),
        Entry("Td", "td", "9", 0, 9999, 0, "s", "derivative time, 0: none"),
        Entry("CB.LO", "cutback", "17", 1, 9999, 1, "°C", "cutback low, one proportional band"),
        Entry("CB.HI", "cutback", "18", 1, 9999, 1, "°C", "cutback high, one proportional band"),
    ),
    period_s=2.0, decimal=True,
    notes=(
        "ranges and decimals of the 16-bit registers are as configured (one place is taken here): they were not read",
        "the proportional band is in % of the span, as section 11.3.10 of HA028651 reckons; an instrument that shows "
        "it in display units takes the °C of the sheet instead",
        "a cutback of one proportional band leaves the band where it is; the rule beyond that is not published",
        "pulses follow a minimum pulse time, whose law is not published: a period of 2 s is proven; not for a relay",
        "the memory takes 100,000 writes: never write these registers again and again",
    ),
)

_JUMO: Final = Make(
    title="JUMO diconTOUCH (Modbus address tables, controller 1, parameter block 1; data sheet 703571)",
    sample_s=(0.25, 0.25), sampling="250 ms, an assumption: not read",
    menu="controller 1, parameter block 1",
    entries=(
        Entry("XP1", "band", "1099H", 0.1, 9999.0, 1, "°C", "proportional band", real=True),
        Entry("TV1", "td", "109DH", 0.0, 9999.0, 0, "s", "derivative time, 0: none", real=True),
        Entry("TN1", "ti", "10A1H", 0.0, 9999.0, 0, "s", "reset time, 0: none", real=True),
        Entry("CY1", "cycle", "10A5H", 0.1, 999.9, 1, "s", "cycle time", real=True),
        Entry("Y0", "fixed", "10B0H", 0, 0, 0, "%", "working point", 0),
        Entry("Y1", "high", "10B1H", 1, 100, 0, "%", "output value limit"),
        Entry("TK1", "fixed", "10B3H", 0.0, 0.0, 1, "s", "minimum on time", 0, real=True),
    ),
    notes=("a float takes two registers; the order of its two words is that of the instrument's interface manual",),
)

_ABB: Final = Make(
    title="ABB Commander 300 (serial communications supplement, section 8.6; operating manual, section 7.2)",
    sample_s=(0.25, 0.25), sampling="250 ms, an assumption: not read",
    menu="control page",
    entries=(
        Entry("CT", "cycle", "CT", 10, 3000, 1, "s", "cycle time"),
        Entry("PB", "band%", "PB", 1, 9999, 1, "% of the span", "proportional band"),
        Entry("IT", "ti7201", "IT", 1, OFF_7201, 0, "s", "integral action time, 7201: none"),
        Entry("DT", "td", "DT", 0, 9999, 1, "s", "derivative action time, 0: none"),
        Entry("AB", "approach", "AB", 1, 30, 1, "bands", "approach band: the derivative acts within it", 30),
    ),
    notes=(
        "no Modbus: the addresses are mnemonics of its ANSI X3.28 messages, values are sent with their decimal point",
        "P.I.D. offset (OF) must be 0",
    ),
)

_OMEGA: Final = Make(
    title="Omega CN7200/7500/7600/7800 and Delta DTA/DTB (register list of Delta's DT4848)",
    sample_s=(0.4, 0.4), sampling="0.4 s, as often as its reading is new",
    menu="regulation mode: Pb, ti, td, offset of the integral; initial setting: cycle",
    entries=(
        Entry("Pb", "band", "1009H", 1, 9999, 1, "°C", "proportional band"),
        Entry("ti", "ti", "100AH", 0, 9999, 0, "s", "integral time, 0: none", read=False),
        Entry("td", "td", "100BH", 0, 9999, 0, "s", "derivative time, 0: none", read=False),
        Entry("ioF", "fixed", "100CH", 0, 0, 1, "%", "integration default", 0),
        Entry("CYCLE1", "cycle", "1007H", 0, 99, 0, "s", "heating control cycle; 0: 0.5 s"),
    ),
    codes={0: 0.5},
    notes=(
        "1009H is 4105; lists that begin with the reading at 4095 count from one less",
        "the ranges of ti and td were not read; write access has to be enabled first (bit 0810H)",
    ),
)

#: name of a target → its make
MAKES: Final[Mapping[str, Make]] = {
    "pband": _GENERIC, "omron-e5cc": _OMRON, "eurotherm-3200": _EUROTHERM, "jumo-dicon": _JUMO,
    "abb-commander-300": _ABB, "omega-cn7800": _OMEGA,
}
