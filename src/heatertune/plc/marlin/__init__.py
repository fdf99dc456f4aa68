"""Marlin's PID of a hot end; what depends on the firmware's build stands in DIFFERENCES.md."""
