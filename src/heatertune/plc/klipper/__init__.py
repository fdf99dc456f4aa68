"""Klipper and Kalico: the PID of a heater of a printer, as its host computes it."""
