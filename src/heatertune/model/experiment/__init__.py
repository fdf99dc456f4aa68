"""The next experiment: the test that reduces the uncertainty of a heater most."""
