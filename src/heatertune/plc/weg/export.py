"""Words as structured text: a program with WEG's block, and one with a block of its own, also as a PLCopen project.

The own FUNCTION_BLOCK is `step.call` with the default of every open point, one statement per line; tests compare both.
TYPE, ACTION, EN and ENO are keywords, so its parameters are Form, Acting, Enable and Enabled. The help does not say
whether WEG's block measures Ts itself, so the program calls a second instance three times in the first scan to find
out.

The programs run in the emulator for structured text; WEG's block is firmware and uses the model of the proof. No file
was tried in WPS or another vendor's tool; independent parsers read them. Parameters are read back from text, too.
"""

from __future__ import annotations

from collections.abc import Callable, Mapping
from functools import partial
from typing import Any, Final

from heatertune.plc.cpu.iec.machine import Firmware, TextProgram
from heatertune.plc.cpu.iec.st_syntax import units
from heatertune.plc.keyed_entry import entry_texts
from heatertune.plc.readback import ReadBack
from heatertune.plc.st.exported_program import ExportedProgram, check_project
from heatertune.plc.st.plcopen import project
from heatertune.plc.st.program_text import (
    LARGEST,
    BlockSource,
    ProgramLimits,
    Variable,
    by_hand,
    clock_for,
    comment,
    enable_condition,
    entered_setpoint,
    function_block,
    head_of,
    instance_call,
    literal,
    program,
    proven_setpoint,
    statements,
    variables,
)
from heatertune.plc.st.readback import ExpectedBlock, words_in
from heatertune.plc.weg.step import BLOCK, COLD, WegAssumptions, WegInputs, WegState, call, made_of
from heatertune.plc.weg.words import COUNTS, FIELDS, REVERSE
from heatertune.plc.words import Certificate, EntryChange, Words

__all__ = [
    "KEEPS", "PROBE", "PROBED", "RENAMED", "SOURCE", "entries", "export_words", "from_text", "loaders",
    "setpoint_entry", "ts_variables",
]


_CALL: Final = "weg_pid_call.st"
_EXPORTED_BLOCK: Final = "weg_pid_block.st"
_PROJECT: Final = "weg_pid_plcopen.xml"
_INPUTS: Final = {"EN": "BOOL", "SetPoint": "REAL", "ManualSetPoint": "REAL", "SelectSetPoint": "BOOL",
                  "Feedback": "REAL"}


def loaders(files: Mapping[str, str | bytes], assume: WegAssumptions) -> dict[str,
                                                                              Callable[[], ExportedProgram | None]]:
    """Return the functions that load each file; the block of our own stands for the default assumptions alone."""
    loads: dict[str, Callable[[], ExportedProgram | None]] = {_CALL: lambda: _called(str(files[_CALL]), assume)}
    if assume == WegAssumptions():
        loads |= {_EXPORTED_BLOCK: lambda: ExportedProgram(TextProgram(units(str(files[_EXPORTED_BLOCK])), {})),
                  _PROJECT: lambda: check_project(str(files[_PROJECT]), str(files[_EXPORTED_BLOCK]), _EXPORTED_BLOCK)}
    return loads


def _called(text: str, assume: WegAssumptions) -> ExportedProgram:
    """Load the program that calls WEG's own block, whose clock, where it keeps Ts, is the program's."""
    loaded: list[TextProgram] = []
    loaded.append(TextProgram(units(text), {"FB_PID": _firmware(assume, lambda: bool(loaded[0]["HeaterDue"]))}))
    return ExportedProgram(loaded[0])


def _firmware(assume: WegAssumptions, due: Callable[[], bool]) -> Firmware:
    """Return WEG's block under the assumptions; `due` tells whether Ts is over, where it keeps Ts itself."""
    def run_when_due(r: list[Any], w: list[Any], f: list[Any], a: int, b: int, c: int) -> None:
        if not w[b] or due():
            fb_pid(r, w, f, a, b, c)

    return Firmware({**_INPUTS, **{field.name: field.format for field in FIELDS}, "Output": "REAL"},
                    run=run_when_due if assume.sampling == BLOCK else fb_pid,
                    keeps=(*COLD, *(int(setting) for setting in assume)))


def fb_pid(r: Any, w: Any, _f: Any, a: int, b: int, _c: int) -> None:
    """Run WEG's block on the rows: variables in the order of `_firmware`, then its state and the assumptions."""
    assume = WegAssumptions(
        int(w[b + 8]), w[b + 9] != 0, w[b + 10] != 0, w[b + 11] != 0, w[b + 12] != 0, w[b + 13] != 0, w[b + 14] != 0,
        int(w[b + 15]))
    block = made_of(r[a + 3], r[a + 4], r[a + 5], r[a + 6], r[a + 7], r[a + 8], w[b + 4], w[b + 2] != 0, w[b + 3] != 0,
                    assume)
    before = WegState(w[b + 5] != 0, r[a + 10], r[a + 11], r[a + 12], r[a + 13], w[b + 6] != 0, w[b + 7] != 0)
    after = call(block, assume, before, WegInputs(r[a], r[a + 2], r[a + 1], w[b + 1] != 0, w[b] != 0))
    w[b + 5], w[b + 6], w[b + 7] = after.enabled, after.overflow, after.skips
    r[a + 10], r[a + 11], r[a + 12], r[a + 13] = after.reference, after.error, after.integral, after.output
    r[a + 9] = after.output


#: the block is called each scan where it is TRUE
KEEPS: Final = "BlockKeepsTs"
#: instance that tells who keeps Ts
PROBE: Final = "HeaterProbe"
_PROBE_VARIABLES: Final = (
    ("HeaterProbed", "BOOL", "FALSE", "BlockKeepsTs is found out"),
    ("HeaterBefore", "REAL", "0.0", "%, of the probe a call before"),
)
#: an I part that moves with each call that computes; Ts is longer than any scan
_PROBES: Final = (
    f"  {PROBE}(SetPoint := 1.0, ManualSetPoint := 0.0, SelectSetPoint := FALSE, Feedback := 0.0, Kp := 1.0,\n"
    "    Ki := 0.1, Kd := 0.0, TauSetPoint := 0.0, MinimumOutput := 0.0, MaximumOutput := 100.0, Type := 0,\n"
    "    Action := 0, Ts := 60000);\n")
PROBED: Final = (
    "(* who keeps Ts? a block that does computes once at most in the last two of three calls in one scan *)\n"
    f"IF NOT HeaterProbed THEN\n  {PROBE}.EN := TRUE;\n{_PROBES}{_PROBES}  HeaterBefore := {PROBE}.Output;\n{_PROBES}"
    f"  {KEEPS} := {PROBE}.Output = HeaterBefore;\n  HeaterProbed := TRUE;\nEND_IF;\n")


def ts_variables(keeps_ts: bool | None) -> tuple[Variable, ...]:
    """Return the variables for a block that keeps Ts itself or not; None: the program finds out."""
    variable = (KEEPS, "BOOL", str(bool(keeps_ts)).upper(), "TRUE: the block itself keeps Ts and is called each scan")
    return (variable, *(_PROBE_VARIABLES if keeps_ts is None else ()))


#: section → (name, type, initial value, meaning)
_DECLARATIONS: Final[dict[str, tuple[tuple[str, str, str, str], ...]]] = {
    "VAR_INPUT": (
        ("Enable", "BOOL", "", "EN of WEG's block"),
        ("SetPoint", "REAL", "", "degC"),
        ("ManualSetPoint", "REAL", "", "output in manual, %"),
        ("SelectSetPoint", "BOOL", "", "TRUE: manual"),
        ("Feedback", "REAL", "", "degC"),
        ("MinimumOutput", "REAL", "", "%"),
        ("MaximumOutput", "REAL", "", "%"),
        ("Kp", "REAL", "", "proportional gain"),
        ("Ki", "REAL", "", "integral gain"),
        ("Kd", "REAL", "", "derivative gain"),
        ("TauSetPoint", "REAL", "", "setpoint filter, s"),
        ("Form", "BYTE", "", "Type of WEG's block: 0 academic, 1 parallel"),
        ("Acting", "BYTE", "", "Action of WEG's block: 0 direct, 1 reverse"),
        ("Ts", "UINT", "", "interval of the calls, ms"),
    ),
    "VAR_OUTPUT": (
        ("Enabled", "BOOL", "", "ENO of WEG's block"),
        ("Output", "REAL", "", "%"),
    ),
    "VAR": (
        ("WasEnabled", "BOOL", "", "Enable of the call before"),
        ("LastFiltered", "REAL", "", "filtered setpoint of the call before"),
        ("LastError", "REAL", "", "e(k-1)"),
        ("IntegralPart", "REAL", "", "i(k-1)"),
        ("Starts", "BOOL", "", "positive edge of Enable"),
        ("Valid", "BOOL", "", "e(k) is a number"),
        ("Seconds", "REAL", "", "Ts, s"),
        ("KiTs", "REAL", "", "Ki*Ts"),
        ("KdByTs", "REAL", "", "Kd/Ts"),
        ("Before", "REAL", "", "filtered setpoint from which this call goes on"),
        ("Filtered", "REAL", "", "filtered setpoint"),
        ("Error", "REAL", "", "e(k)"),
        ("Growth", "REAL", "", "of the integral part"),
        ("Wanted", "REAL", "", "output before its limits"),
        ("Sum", "REAL", "", "new integral part"),
        ("Proportional", "REAL", "", "Kp*e(k)"),
    ),
    "VAR CONSTANT": (
        ("Largest", "REAL", LARGEST, "the largest REAL"),
    ),
}

_BODY: Final = """\
Enabled := Enable;
IF NOT Enable THEN
  WasEnabled := FALSE;
ELSE
  Starts := NOT WasEnabled;
  Before := LastFiltered;
  IF Starts THEN
    Before := SetPoint;
  END_IF;
  Seconds := UINT_TO_REAL(Ts) / 1000.0;
  KiTs := Ki * Seconds;
  KdByTs := Kd / Seconds;
  Filtered := Before + (Seconds / (TauSetPoint + Seconds)) * (SetPoint - Before);
  IF Acting = 0 THEN
    Error := Filtered - Feedback;
  ELSE
    Error := Feedback - Filtered;
  END_IF;
  Valid := ABS(Error) <= Largest; (* not so for a broken sensor or an overflow: nothing is remembered then *)
  IF Starts AND Valid THEN
    WasEnabled := TRUE;
    LastFiltered := SetPoint;
    LastError := Error;
    IntegralPart := 0.0;
    Output := 0.0;
  ELSE
    IF SelectSetPoint THEN
      Wanted := ManualSetPoint;
    ELSIF NOT Valid THEN
      Wanted := MinimumOutput;
    ELSIF Form = 0 THEN
      Wanted := IntegralPart + Kp * (((1.0 + KiTs) + KdByTs) * Error - KdByTs * LastError);
      Growth := (Kp * KiTs) * Error;
    ELSE
      Wanted := IntegralPart + (((Kp + KiTs) + KdByTs) * Error - KdByTs * LastError);
      Growth := KiTs * Error;
    END_IF;
    Output := Wanted;
    IF NOT (Output >= MinimumOutput) THEN (* also where it is no number: the heater goes off *)
      Output := MinimumOutput;
    ELSIF Output > MaximumOutput THEN
      Output := MaximumOutput;
    END_IF;
    IF Valid AND NOT SelectSetPoint THEN
      LastFiltered := Filtered;
      LastError := Error;
      Sum := IntegralPart + Growth;
      IF KiTs <> 0.0 THEN (* proportional and integral part together stay within the limits *)
        Proportional := Kp * Error;
        IF Sum < MinimumOutput - Proportional THEN
          Sum := MinimumOutput - Proportional;
        END_IF;
        IF Sum > MaximumOutput - Proportional THEN
          Sum := MaximumOutput - Proportional;
        END_IF;
      END_IF;
      IF ABS(Sum) <= Largest THEN
        IntegralPart := Sum;
      END_IF;
    END_IF;
  END_IF;
END_IF;
"""

SOURCE: Final = BlockSource("HT_WEG_PID", _DECLARATIONS, _BODY)


_WIRES = (
    ("ManualSetPoint", "HandPower"), ("SelectSetPoint", "ByHand"), ("Feedback", "HeaterTemperature"),
)

#: input of WEG's block → input of the exported one, where the language reserves the name
RENAMED: Final = {"Type": "Form", "Action": "Acting"}


def export_words(words: Words, certificate: Certificate) -> dict[str, str]:
    """Return the three files; the same words and certificate give the same bytes."""
    clock, setpoint = clock_for(words, certificate.actuator), proven_setpoint(words, certificate, COUNTS)
    sampling = certificate.switches.get("sampling")
    keeps_ts = None if sampling is None else sampling == "block"
    head = (
        *head_of("heater controller for WEG's PID block", words, words.whole["Ts"], certificate, clock,
                 tool="WPS or another vendor's tool"),
        *by_hand(clock, certificate, of_clock=[_who_keeps_ts(sampling)],
                 of_start=["HeaterOn has to stay TRUE: each time that it rises the first call gives 0"]))
    remarks = comment(*head)
    limits = ProgramLimits(words.values["MaximumOutput"], words.values["Action"] == REVERSE)
    own = variables(words, clock, setpoint)
    body = statements(words, clock, _block_call(words), limits)
    wegs = variables(words, clock, setpoint, ts_variables(keeps_ts))
    calls = statements(words, clock, _weg_call(words), limits, before=PROBED if keeps_ts is None else "", or_when=KEEPS)
    instances = {"HeaterPid": "FB_PID"} | ({PROBE: "FB_PID"} if keeps_ts is None else {})
    return {
        "weg_pid_call.st": remarks + program("WegHeater", instances, wegs, calls),
        "weg_pid_block.st":
            remarks + function_block(SOURCE) + "\n" + program("Heater", {"HeaterPid": SOURCE.name}, own, body),
        "weg_pid_plcopen.xml": project(SOURCE, own, body, head, clock.tick_ms),
    }


def _who_keeps_ts(stated: str | None) -> str:
    """Return what is known of it, or that the program finds out."""
    if stated == "block":
        return "WEG's block keeps Ts itself, as you told (block): BlockKeepsTs is TRUE, and it is called each scan"
    if stated is not None:
        return f"WEG's block is called each Ts, as you told ({stated}): BlockKeepsTs is FALSE"
    return (f"who keeps Ts, WEG's block or its caller, the first scan after each start-up finds out ({PROBE}): "
            "BlockKeepsTs then shows it; a ladder of your own has to know")


def entries(words: Words, _setpoint_degC: float | None, _units: object) -> dict[str, EntryChange]:
    """Return each word as the exported files have it, see `heatertune.plc.keyed_entry.KeyedEntry`."""
    return entry_texts(dict(_values(words)))


def _values(words: Words) -> list[tuple[str, str]]:
    return [(f.name, literal(words.values[f.name]) if f.format == "REAL" else str(words.whole[f.name])) for f in FIELDS]


def _wires(words: Words) -> list[tuple[str, str]]:
    return [("SetPoint", "HeaterSetPoint" if words.ramp is None else "HeaterRamp"), *_WIRES]


def _weg_call(words: Words) -> str:
    """Return the statements in the form of the manual's example: EN and Output as members."""
    call = instance_call("HeaterPid", [*_wires(words), *_values(words)])
    return f"HeaterPid.EN := {enable_condition(words)};\n{call}HeaterPower := HeaterPid.Output;\n"


def _block_call(words: Words) -> str:
    values = [(RENAMED.get(name, name), value) for name, value in _values(words)]
    call = instance_call("HeaterPid", [("Enable", enable_condition(words)), *_wires(words), *values])
    return f"{call}HeaterPower := HeaterPid.Output;\n"


#: the setpoint as a person enters it, see `heatertune.plc.controller.Controller`
setpoint_entry: Final = partial(entered_setpoint, COUNTS)


_BLOCK: Final = ExpectedBlock(
    FIELDS, {"Kp": "%/°C", "Ki": "1/s", "Kd": "s", "TauSetPoint": "s", "MinimumOutput": "%", "MaximumOutput": "%",
             "Ts": "ms"},
    renamed={exported: name for name, exported in RENAMED.items()}, neighbour=PROBE)


def from_text(text: str, _sample_time_s: float | None, source: str) -> ReadBack:
    """Return the words in a text, and the inputs of the block that are none; errors as `words_in`."""
    return words_in(text, source, _BLOCK)
