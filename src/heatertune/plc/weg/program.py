"""What the program around WEG's own block has beside that around any: it finds out who keeps Ts.

The help does not tell it: a second instance is called three times in the first scan.
"""

from __future__ import annotations

from typing import Final

from heatertune.plc.st.program import Variable

__all__ = ["KEEPS", "PROBE", "PROBED", "ts_variables"]

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
    kept = (KEEPS, "BOOL", str(bool(keeps_ts)).upper(), "TRUE: the block itself keeps Ts and is called each scan")
    return (kept, *(_PROBE_VARIABLES if keeps_ts is None else ()))
