"""The PID of the IEC 61131-3 text, repaired; DIFFERENCES.md lists the repairs."""
