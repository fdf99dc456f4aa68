"""Firmware and libraries with a PID: what their rows, laws and texts share; each has a folder named as its target."""
