"""The SIMATIC S5: its statements."""
