"""The PID instruction of an S7-200 (CPU 22x) and its loop table; DIFFERENCES.md lists its open points."""
