"""The paper's PID/PWM program on an S7-200, repaired; DIFFERENCES.md lists sources and differences."""
