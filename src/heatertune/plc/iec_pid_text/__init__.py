"""The PID of the IEC 61131-3 text as compilers ship it, faults included; for comparison."""
