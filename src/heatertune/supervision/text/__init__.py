"""A monitor's numbers → its program in the target's own language, and whether that says the same as the monitor."""
