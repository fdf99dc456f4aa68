"""The paper's PID/PWM program as printed, its faults included; what it leaves open stands in DIFFERENCES.md."""
