"""The block as a FUNCTION_BLOCK in structured text: `step.call`, one statement per line of it; the tests run both.

TIME_TO_REAL gives seconds in one system and other units in others; the quotient by T#1s is seconds in all of them.
"""

from __future__ import annotations

from typing import Final

from heatertune.plc.st.source import LARGEST, BlockSource

__all__ = ["SOURCE"]

SOURCE: Final = BlockSource("HT_IEC_PID", {
    "VAR_INPUT": (
        ("RUN", "BOOL", "", "FALSE: off, and the next call begins anew"),
        ("AUTO", "BOOL", "", "FALSE: by hand"),
        ("PV", "REAL", "", "temperature, degC"),
        ("SP", "REAL", "", "setpoint, degC"),
        ("X0", "REAL", "", "output by hand, %"),
        ("KP", "REAL", "", "% per degC; above 0 for a heater, below 0 for a cooler"),
        ("TR", "REAL", "", "reset time, s; 0: no I part"),
        ("TD", "REAL", "", "derivative time, s"),
        ("XMIN", "REAL", "", "lower limit of XOUT, %"),
        ("XMAX", "REAL", "", "upper limit of XOUT, %"),
        ("CYCLE", "TIME", "", "interval of the calls"),
    ),
    "VAR_OUTPUT": (
        ("XOUT", "REAL", "", "%"),
    ),
    "VAR": (
        ("Begun", "BOOL", "", "the memory below holds"),
        ("Seconds", "REAL", "", "CYCLE, s"),
        ("Error", "REAL", "", "SP - PV"),
        ("Error1", "REAL", "", "of the call before"),
        ("Error2", "REAL", "", "two calls ago"),
        ("Error3", "REAL", "", "three calls ago"),
        ("IntegralPart", "REAL", "", "I part, %"),
        ("Proportional", "REAL", "", "P part, %"),
        ("Slope", "REAL", "", "of the error, degC/s"),
        ("Sum", "REAL", "", "new I part"),
        ("Wanted", "REAL", "", "output before its limits"),
    ),
    "VAR CONSTANT": (
        ("Largest", "REAL", LARGEST, "the largest REAL"),
    ),
}, """\
IF NOT RUN THEN
  Begun := FALSE;
  XOUT := 0.0;
ELSE
  Seconds := TIME_TO_REAL(CYCLE) / TIME_TO_REAL(T#1s); (* whatever the unit of TIME_TO_REAL *)
  Error := SP - PV;
  Wanted := X0;
  IF ABS(Error) <= Largest THEN
    IF NOT Begun OR NOT AUTO THEN
      Error1 := Error;
      Error2 := Error;
      Error3 := Error;
    END_IF;
    IF NOT Begun THEN
      Begun := TRUE;
      IntegralPart := 0.0;
    END_IF;
    Proportional := KP * Error;
    IF AUTO THEN
      IF TR <> 0.0 THEN
        Sum := IntegralPart + ((KP * Seconds) / TR) * Error;
        IF Sum < XMIN - Proportional THEN (* P and I part together stay within the limits *)
          Sum := XMIN - Proportional;
        END_IF;
        IF Sum > XMAX - Proportional THEN
          Sum := XMAX - Proportional;
        END_IF;
        IF ABS(Sum) <= Largest THEN
          IntegralPart := Sum;
        END_IF;
      ELSE
        IntegralPart := 0.0;
      END_IF;
      Wanted := Proportional + IntegralPart;
      IF TD <> 0.0 THEN
        Slope := (3.0 * (Error - Error3) + Error1 - Error2) / (10.0 * Seconds);
        Wanted := Wanted + KP * (TD * Slope);
      END_IF;
      Error3 := Error2;
      Error2 := Error1;
      Error1 := Error;
    END_IF;
  ELSIF AUTO THEN (* a broken sensor or an overflow: nothing is remembered *)
    Wanted := XMIN;
  END_IF;
  XOUT := Wanted;
  IF NOT (XOUT >= XMIN) THEN (* also where it is no number: the heater goes off *)
    XOUT := XMIN;
  ELSIF XOUT > XMAX THEN
    XOUT := XMAX;
  END_IF;
  IF ABS(Error) <= Largest AND NOT AUTO THEN (* so that the return to automatic is without a bump *)
    Sum := 0.0;
    IF TR <> 0.0 THEN
      Sum := XOUT - Proportional;
    END_IF;
    IF ABS(Sum) <= Largest THEN
      IntegralPart := Sum;
    END_IF;
  END_IF;
END_IF;
""")
