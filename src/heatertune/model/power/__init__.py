"""A log with power: the heater that explains it, what else might, and what the log leaves open."""
