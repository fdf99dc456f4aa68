"""Several zones in one PLC: simulated, recorded, written and watched together."""
