"""The paper's PID/PWM program on an S7-200, repaired; what was followed and what differs stands in DIFFERENCES.md."""
