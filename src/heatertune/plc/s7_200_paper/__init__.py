"""The paper's PID/PWM program as printed, its faults included; DIFFERENCES.md lists its open points."""
