"""A log without power: the heater and its controller, found together."""
