"""The PID of the IEC 61131-3 text, repaired; what was wrong stands in DIFFERENCES.md."""
