"""Logs with power: the heater that explains the log, alternative explanations, and the remaining uncertainty."""
