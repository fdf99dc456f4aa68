"""The next experiment: which test of the heater tells what is not known yet."""
