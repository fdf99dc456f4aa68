"""The program around the PID instruction as a statement list, and the loop table as the CPU holds it; and read back.

Loop table at VB100 (36 bytes, or 80 with the auto-tune part, REALs with their high byte first), input AIW0, PWM on
Q0.0.
"""

from __future__ import annotations

import re
import struct
from collections.abc import Mapping, Sequence
from typing import Final

from heatertune.errors import InputError
from heatertune.plc.cpu.s7_200.assembler import (
    Network,
    block,
    count_ticks,
    program,
    pwm_registers,
    real,
    timed_interrupt,
)
from heatertune.plc.cpu.s7_200.io_and_cycle import SWITCH, clock, cycle_ms, head, ticks_of, whole_cycle
from heatertune.plc.cpu.s7_200.readback import DataBlockMemory, LoadedNumber, difference, is_program, loads
from heatertune.plc.firmware.firmware_text import blank_matches
from heatertune.plc.inputs import BROKEN_MA, FOUR_TO_TWENTY, INPUTS, has_ends, module, share_of
from heatertune.plc.print.statements import setpoint_ramp
from heatertune.plc.print.stl import networks, ramp_begins
from heatertune.plc.ramp import Number
from heatertune.plc.readback import PastedNames, ReadBack, WordCollector, put_pasted, unread_lines, wrong
from heatertune.plc.s7_200_pid.step import STEP, measure
from heatertune.plc.s7_200_pid.words import FIELDS, FULL, NO_INTEGRAL, RANGES, SETPOINT, TABLE
from heatertune.plc.single_precision import single
from heatertune.plc.words import Certificate, Words

__all__ = [
    "COUNTDOWN", "SETPOINT_INPUT", "export_words", "from_image", "from_text", "in_degrees", "least_good",
    "oddities", "pid_program", "setpoint_entry", "to_image",
]


_SHORT, _LONG = 36, 80
_ID: Final = b"PIDA"  # marks the extended table (System Manual, Table 6-44 of the later editions)

#: auto-tune part as the CPU sets it up: DEV, HYS, STEP, WDOG; the results 0
_AUTO_TUNE: Final = struct.pack(">4B 4f 5f", 0, 0, 0, 0, 0.1, 0.025, 0.1, 7200.0, *[0.0] * 5)


def to_image(words: Words, *, extended: bool = False) -> bytes:
    """Return 36 or 80 bytes; process variable, setpoint, output, bias and last process variable are 0."""
    v = words.values
    table = struct.pack(">9f", 0.0, 0.0, 0.0, v["KC"], v["TS"], v["TI"], v["TD"], 0.0, 0.0)
    return table + (_ID + _AUTO_TUNE if extended else b"")


def from_image(image: bytes, sample_time_s: float, source: str) -> dict[str, Number]:
    """Return the values in a loop table of 36 or 80 bytes, whose Ts may be another than the sampling interval [s].

    Raises:
        InputError: another length, or 80 bytes without the mark of the extended table.
        NotRepresentable: an interval that the PWM program cannot do.
    """
    if len(image) not in (_SHORT, _LONG):
        raise InputError(f"{source}: {len(image)} bytes; expected {_SHORT} or {_LONG} (loop table)")
    if len(image) == _LONG and image[_SHORT : _SHORT + 4] != _ID:
        raise InputError(f"{source}: {image[_SHORT:_SHORT + 4]!r} at byte {_SHORT}; expected {_ID!r} (extended table)")
    kc, ts, ti, td = struct.unpack(">4f", image[12:28])
    return {"KC": kc, "TS": ts, "TI": min(ti, NO_INTEGRAL), "TD": td, **ticks_of(whole_cycle(sample_time_s))}


def oddities(words: Words) -> tuple[str, ...]:
    """Return what is odd about a loop's words, one sentence each."""
    v = words.values
    odd = []
    if v["KC"] == 0.0:
        odd.append("KC is 0: there is no proportional part; the integral and derivative parts act with a gain of 1.")
    if v["KC"] < 0.0:
        odd.append("KC is negative: the loop cools.")
    if v["TI"] == NO_INTEGRAL:
        odd.append("TI is infinite: the loop has no integral action.")
    elif v["TI"] * 60.0 < 2.0 * v["TS"]:
        odd.append(f"TI is {v['TI']:.4g} min, below two samples: was it meant in seconds?")
    if abs(v["TS"] - words.sample_time_s) > 0.01 * words.sample_time_s:
        odd.append(f"TS is {v['TS']:.4g} s, but the loop is called every {words.sample_time_s:g} s: "
                   "TN and TV are realised as many times longer or shorter.")
    return tuple(odd)


#: where a program with a ramp finds the setpoint asked for, as an analog input word
SETPOINT_INPUT = "VW80"
#: ticks to go
COUNTDOWN = "VW90"

_WIDEST = "32000.0"  # an analog input at the end of its range
#: setpoint on the ramp
_LED = "VW82"
#: the reading of this call, whether it is that of a broken wire, and whether there was one since the call before
_READING, _BROKEN, _BLIND = "VW86", "VW88", "VW92"
_END = 32766  # what an EM231 gives in size where its supply is missing, and nearly so where a wire is broken
#: cells of the setpoint ramp, in double words: what the holdback adds may leave a word
_RAMP: Final = {"ASKED": "VD180", "READING": "VD184", "LEAD": "VD188", "CALLS": "VW84", "SIZE": "VD192",
                "AHEAD": "VD196", "BACK": "VD200", "END": "VD204"}
#: where OB1 leaves what it reads of an EM 231 for temperatures, that this goes on
_READ = "VW94"


def pid_program(words: Words, head: Sequence[str] = ()) -> str:
    """Return the program; the same words and head give the same bytes."""
    first = Network("first scan", ["LD SM0.1", "CALL SBR0"])
    read = Network("the module has a new value only after the last one was read", ["LD SM0.0", f"MOVW AIW0, {_READ}"])
    main = [first, *([read] if in_degrees(words) else [])]
    return program(
        block("OB1", "PID instruction with PWM output", main, head),
        block("SBR0", "loop table, PWM on Q0.0, timed interrupt", _initialisation(words)),
        block("INT0", "one sampling interval: PID, pulse width", _interrupt(words)),
    )


def _initialisation(words: Words) -> list[Network]:
    v = words.values
    addresses = zip(("KC", "TS", "TI", "TD"), range(TABLE + 12, TABLE + 28, 4), strict=True)
    return [
        Network("loop table: gain, sampling interval, times in minutes", [
            "LD SM0.0", *[f"MOVR {real(v[name])}, VD{place}" for name, place in addresses],
        ]),
        Network("output and bias begin at 0", [
            "LD SM0.0", f"MOVR 0.0, VD{TABLE + 8}", f"MOVR 0.0, VD{TABLE + 28}", f"MOVW +1, {COUNTDOWN}",
            f"MOVW +0, {_BLIND}",
        ]),
        Network("reading of the call before: the one at the start, whatever V memory retained",
                _share("AIW0", f"VD{TABLE + 32}")),
        *([] if words.ramp is None else [ramp_begins(words.ramp, {**_RAMP, "READING": "AIW0", "LEAD": _LED})]),
        pwm_registers(cycle_ms(words.whole), "16#DB"),
        timed_interrupt(words.whole["TICK"]),
    ]


def _interrupt(words: Words) -> list[Network]:
    return [
        *count_ticks(COUNTDOWN, f"{words.whole['TICKS']:+d}"),
        *_sensor_fault(words),
        Network("process variable as a share of the range", _share(_READING, f"VD{TABLE}")),
        _seeing_again(words),
        *_setpoint(words),
        Network("setpoint: see VD104; PID", ["LD SM0.0", f"PID VB{TABLE}, 0"]),
        Network("pulse width; the cycle time is loaded once", [
            "LD SM0.0", f"MOVR VD{TABLE + 8}, AC0", f"*R {real(cycle_ms(words.whole))}, AC0", "ROUND AC0, AC0",
            "MOVW AC0, SMW70", "PLS 0", "MOVB 16#DA, SMB67",
        ]),
    ]


def _share(word: str, place: str) -> list[str]:
    return ["LD SM0.0", f"ITD {word}, AC0", "DTR AC0, AC0", f"/R {_WIDEST}, AC0", f"MOVR AC0, {place}"]


def _sensor_fault(words: Words) -> list[Network]:
    """Return what leaves the heater off, and the PID instruction out, while the sensor's wire is broken."""
    least = least_good(words)
    low = ("wire broken, the other way", -_END - 1) if least is None else ("wire broken: below 3.6 mA", least - 1)
    return [
        Network("one reading for all of this call", ["LD SM0.0", f"MOVW AIW0, {_READING}", f"MOVW +0, {_BROKEN}"]),
        Network("wire broken", [f"LDW>= {_READING}, +{_END}", f"MOVW +1, {_BROKEN}"]),
        Network(low[0], [f"LDW<= {_READING}, {low[1]:+d}", f"MOVW +1, {_BROKEN}"]),
        Network("heater off, output and bias 0, no PID", [
            f"LDW>= {_BROKEN}, +1", f"MOVR 0.0, VD{TABLE + 8}", f"MOVR 0.0, VD{TABLE + 28}", f"MOVW +1, {_BLIND}",
            "MOVW +0, SMW70", "PLS 0", "MOVB 16#DA, SMB67", "CRETI",
        ]),
    ]


def least_good(words: Words) -> int | None:
    """Return the least word of a transmitter whose wire is not broken; None: its sensor is none of 4 to 20 mA."""
    if words.scaling.input != FOUR_TO_TWENTY:
        return None
    return round(FULL * share_of(BROKEN_MA, RANGES[FOUR_TO_TWENTY]))


def in_degrees(words: Words) -> bool:
    """Return whether the analog module gives the temperature itself."""
    return has_ends(RANGES, words.scaling.input)


def _seeing_again(words: Words) -> Network:
    """Return what makes the first good reading after a fault the beginning of the loop, as after a start."""
    ramp = [] if words.ramp is None else [f"MOVW {_READING}, {_LED}"]
    return Network("the first reading after that is the one before, too", [
        f"LDW>= {_BLIND}, +1", f"MOVR VD{TABLE}, VD{TABLE + 32}", *ramp, f"MOVW +0, {_BLIND}",
    ])


def _setpoint(words: Words) -> list[Network]:
    """Return what keeps the setpoint in the range, and how a ramp leads it; else the operator's panel writes it."""
    if words.ramp is None:
        return [
            Network("setpoint not above the range", [f"LDR>= {SETPOINT}, 1.0", f"MOVR 1.0, {SETPOINT}"]),
            Network("setpoint not below the range", [f"LDR<= {SETPOINT}, 0.0", f"MOVR 0.0, {SETPOINT}"]),
        ]
    input_word = SETPOINT_INPUT
    return [
        Network("setpoint not above the range", [f"LDW>= {input_word}, +32000", f"MOVW +32000, {input_word}"]),
        Network("setpoint not below the range", [f"LDW<= {input_word}, +0", f"MOVW +0, {input_word}"]),
        Network("setpoint asked for, reading and setpoint on its ramp in 32 bits", [
            "LD SM0.0", *(f"ITD {word}, {_RAMP[name]}" for name, word in (
                ("ASKED", input_word), ("READING", _READING), ("LEAD", _LED)))]),
        *networks(setpoint_ramp(words.ramp), _RAMP),
        Network("setpoint on its ramp in 16 bits", ["LD SM0.0", f"MOVD {_RAMP['LEAD']}, AC0", f"MOVW AC0, {_LED}"]),
        Network("setpoint as a share of the range", _share(_LED, SETPOINT)),
    ]


_REALS: Final = tuple(field for field in FIELDS if field.format == "REAL")


def from_text(text: str, sample_time_s: float | None, source: str) -> ReadBack:
    """Return the words in a statement list, or in a data block or a list of values, which know no timed interrupt.

    Raises:
        InputError: a bad line, a word that is missing, there with two values or out of its range; a data block without
            the interval at which the loop is called.
        NotRepresentable: an interval that the PWM program cannot do.
    """
    collected = WordCollector(source, FIELDS)
    listed = _COMMENTED.sub(r"\2 = \1", text)
    if not is_program(text) and not _OWN_TABLE.search(text) and _NAMED.search(listed):
        return _from_list(listed, collected, sample_time_s, source)
    if not is_program(text):
        return _from_memory(DataBlockMemory(text, source), collected, sample_time_s)
    loaded, offset = loads(text, source), _table(text, source) - TABLE
    for field in _REALS:
        for number in loaded.get(f"VD{int(field.address[2:]) + offset}", ()):
            collected.put(field.name, number.value, number.line, number.shown)
    assumed = () if _has_ticks(loaded, collected, source) else _pulses(collected, sample_time_s, source)
    return ReadBack(collected.values(), unlike=lambda words: difference(text, pid_program(words)), assumed=assumed)


def _has_ticks(loaded: Mapping[str, Sequence[LoadedNumber]], collected: WordCollector, source: str) -> bool:
    """Store the ticks of the PWM, and return whether the program has one."""
    cycles = loaded.get("SMW68", ())
    for tick in loaded.get("SMB34", ()) if cycles else ():  # without a PWM the interrupt may be of anything
        collected.put("TICK", tick.value, tick.line, tick.shown)
        for cycle in cycles:
            if tick.value <= 0 or cycle.value % tick.value:
                whole = f"whole ticks: a multiple of SMB34 = {tick.shown}"
                raise wrong(source, cycle.line, "SMW68", cycle.shown, whole)
            collected.put("TICKS", int(cycle.value // tick.value), cycle.line, cycle.shown)
    return bool(cycles)


def _table(text: str, source: str) -> int:
    """Return where the loop table begins, as the PID instruction says."""
    tables = {int(match[1]): match for match in _PID.finditer(text)}
    if len(tables) > 1:
        raise InputError(f"{source}: PID instructions with the tables {', '.join(f'VB{n}' for n in tables)}; expected "
                         "the program of one loop: leave the others out")
    return next(iter(tables), TABLE)


def _pulses(collected: WordCollector, sample_time_s: float | None, source: str) -> tuple[str, ...]:
    """Fill in the PWM of the exported program, whose cycle is the interval; return what was assumed.

    Raises:
        InputError: neither an interval nor a sample time is known.
        NotRepresentable: an interval that the PWM program cannot do.
    """
    stated = collected.get("TS")
    interval = stated if sample_time_s is None else sample_time_s
    if interval is None:
        raise InputError(f"--called-every is needed: {source} has no sample time")
    collected.assume(ticks_of(whole_cycle(interval)))
    assumption = () if sample_time_s else (f"called every {interval:g} s",)
    return (*assumption, f"the heater is switched by a PWM with a cycle of {interval:g} s")


_PID: Final = re.compile(r"^\s*PID\s+VB\s?(\d+)", re.IGNORECASE | re.MULTILINE)
_OWN_TABLE: Final = re.compile(r"^\s*V[BWD]\s?1[0-3]\d\s", re.IGNORECASE | re.MULTILINE)
#: an entry of the wizard's own data block, whose table begins elsewhere: its comment says what it is
_COMMENTED: Final = re.compile(r"^\s*VD\s?\d+\s+(\S+)\s*//\s*([^\r\n]*?)\s*$", re.IGNORECASE | re.MULTILINE)
_COMMENT: Final = re.compile(r"//[^\r\n]*")
#: name on the wizard's page, or in the symbol table that it makes → word
_SHOWN: Final = {
    **dict.fromkeys(("loop gain", "gain", "Kp", "Verstärkung"), "KC"),
    **dict.fromkeys(("sample time", "SampleTime", "Abtastzeit"), "TS"),
    **dict.fromkeys(("integral time", "I_Time", "reset", "Integralzeit", "Nachstellzeit"), "TI"),
    **dict.fromkeys(("derivative time", "D_Time", "rate", "Differentialzeit", "Vorhaltezeit"), "TD"),
}
_NAMED: Final = re.compile("|".join(("KC", *_SHOWN)).replace(" ", r"[\s_-]+"), re.IGNORECASE)
_UNITS_S: Final = {"TS": 1.0, "TI": 60.0, "TD": 60.0}
_NEEDED: Final = {"KC": "Gain = 2.0", "TI": "Integral time = 10 min", "TD": "Derivative time = 0 min"}


def _from_list(text: str, collected: WordCollector, sample_time_s: float | None, source: str) -> ReadBack:
    """Return the words in a list as the wizard's page shows it: TI and TD in minutes where no unit is told.

    Raises:
        InputError: as `put_pasted`; no sample time, and no interval.
        NotRepresentable: an interval that the PWM program cannot do.
    """
    pasted_names = PastedNames(_REALS, _SHOWN, _UNITS_S, frozenset(_UNITS_S), "the S7-200's PID")
    plain = blank_matches(_COMMENT, text)
    words = put_pasted(collected, plain, pasted_names, _NEEDED, source)
    bare = [word.name for word in words if word.name in ("TI", "TD") and word.value and not word.has_unit]
    minutes = (f"{' and '.join(dict.fromkeys(bare))} in minutes",) if bare else ()
    if sample_time_s is not None:
        collected.assume({"TS": single(sample_time_s)})
    assumed = (*minutes, *_pulses(collected, sample_time_s, source))
    return ReadBack(collected.values(), unread_lines(plain, pasted_names), assumed=assumed)


def _from_memory(memory: DataBlockMemory, collected: WordCollector, sample_time_s: float | None) -> ReadBack:
    for field in _REALS:
        number = memory.read(field.name, field.address, real=True)
        if number is not None:
            collected.put(field.name, number.value, number.line, number.shown)
    if sample_time_s is None:
        raise InputError("--called-every is needed: a data block does not tell how often the loop is called")
    assumed = _pulses(collected, sample_time_s, "")
    return ReadBack(collected.values(), memory.rest, assumed=assumed)


def export_words(words: Words, certificate: Certificate) -> dict[str, str | bytes]:
    """Return the program that was proven, and the loop table in both lengths."""
    s = words.scaling
    least = least_good(words)
    low, high = s.sensor_degC
    begins, range_ = ("0", "that range") if least is None else (
        "4...20 mA = 6400", f"0...{FULL}, which is {s.low_degC:g}...{s.high_degC:g} degC,")
    facts = [
        f"sensor {low:g}...{high:g} degC = {begins}...{FULL} on AIW0; heater switch on Q0.0",
        f"setpoint as a share of {range_} in {SETPOINT}" if words.ramp is None
        else f"setpoint asked for in {SETPOINT_INPUT}, as an analog input word; its ramp writes {SETPOINT}",
        clock(words.whole),
    ]
    lines = head(facts, certificate, _by_hand(words, certificate))
    return {
        "s7_200_pid.awl": pid_program(words, lines),
        f"VB{TABLE}_36.bin": to_image(words),
        f"VB{TABLE}_80.bin": to_image(words, extended=True),
    }


def _by_hand(words: Words, certificate: Certificate) -> list[str]:
    place, setpoint_degC = SETPOINT if words.ramp is None else SETPOINT_INPUT, certificate.setpoint_degC
    shown = place
    if setpoint_degC is not None:
        word = measure(module(words.scaling, FULL // STEP, RANGES), setpoint_degC)
        shown = f"{place} = {word / FULL if words.ramp is None else word:.9g}, the proven {setpoint_degC:g} degC"
    return [
        f"CPU 22x; analog input module: the first input, {_range(words)}, is AIW0",
        "system block: analog input filter off for AIW0, for the proof reads without it",
        *SWITCH,
        f"enter the setpoint: {shown}; another one is not proven, and 0 is what a lost memory leaves",
        _wire_break_text(words),
    ]


def _range(words: Words) -> str:
    """Return how the analog input is to be set up."""
    if in_degrees(words):
        return (f"an EM231 for {INPUTS[words.scaling.input or '']} (0.1 degC per digit; switches: its type, degC, "
                "open-wire detection on)")
    return ("0...32000 unipolar = the sensor range" if least_good(words) is None else
            "0 to 20 mA = 0...32000 unipolar, for a transmitter of 4 to 20 mA")


def _wire_break_text(words: Words) -> str:
    """Return which broken wires the program sees."""
    if in_degrees(words):
        return ("a broken wire and a missing supply (32766 and more, -32767 and less) put the heater off; try it out. "
                "An EM231 with a fault of its own gives 0: a limiter must cut the heater")
    least = least_good(words)
    return ("a broken wire is seen where the module gives 32766 and more or -32767 and less (EM231), and a "
            "transmitter's with --input 4-20mA; else a limiter must cut the heater" if least is None else
            f"a broken wire, a current below 3.6 mA (AIW0 below {least}), puts the heater off; try it out")


def setpoint_entry(words: Words, _setpoint_degC: float, units: int) -> str:
    """Return the setpoint as a person enters it, see `heatertune.plc.controller.Controller`."""
    return f"{SETPOINT} = {units / FULL:.9g}" if words.ramp is None else f"{SETPOINT_INPUT} = {units}"
