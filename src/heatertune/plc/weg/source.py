"""The block as a FUNCTION_BLOCK in structured text (IEC 61131-3), for controllers without one of their own.

It is `block.call` with the default of every switch, one statement per line of it; the tests run this text and compare.
TYPE, ACTION, EN and ENO are words of the language, so the block calls them Form, Acting, Enable and Enabled.
"""

from __future__ import annotations

from typing import Final

from heatertune.plc.st.source import LARGEST, BlockSource

__all__ = ["SOURCE"]

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
