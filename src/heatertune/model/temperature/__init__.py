"""Logs without power: identify the heater and its controller together."""
