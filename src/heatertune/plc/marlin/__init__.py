"""Marlin's PID of a hot end; DIFFERENCES.md lists what depends on the firmware's build."""
