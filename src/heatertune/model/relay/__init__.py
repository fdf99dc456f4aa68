"""A relay test: the heater from its swing."""
