"""Runs Kalico's own heater, as its package brings it, on scans given as arrays: `python klipper_driver.py FOLDER IN.npz OUT.npz`."""

import importlib
import sys
import types
from pathlib import Path
from unittest.mock import MagicMock

import numpy as np

REPORT_S = 0.3


class Section(dict):
    """A section of printer.cfg, as far as a heater asks it."""

    def get(self, name, default=None, **_):
        return dict.get(self, name, default)

    getfloat = getint = get

    def __getattr__(self, name):
        return getattr(self["printer"], name)

    def get_printer(self):
        return self["printer"]

    def get_name(self):
        return "extruder"

    def get_prefix_sections(self, _):
        return []


class Pin:
    """The switch: what was sent last, and how often something was."""

    def __init__(self):
        self.sent, self.count = 0.0, 0

    def set_pwm(self, _time, value):
        self.sent, self.count = value, self.count + 1


def heaters_of(folder):
    """Return the module of heaters without the rest of the printer."""
    package = types.ModuleType("extras")
    package.__path__ = [str(Path(folder) / "klippy" / "extras")]
    sys.modules["extras"] = package
    return importlib.import_module("extras.heaters")


def heater_of(module, gains):
    kp, ki, kd, most, smooth = map(float, gains)
    section = Section(printer=MagicMock(), control="pid", pid_kp=kp, pid_ki=ki, pid_kd=kd, max_power=most, smooth_time=smooth,
                      min_temp=-273.15, max_temp=1e9, heater_pin="x")
    sensor = MagicMock()
    sensor.get_report_time_delta.return_value = REPORT_S
    heater = module.Heater(section, sensor)
    heater.mcu_pwm, heater.verify_mainthread_time = Pin(), 1e9
    return heater


def run(module, gains, targets, temperatures, starts, clock=False):
    """Return duty, slope, integral and commands after each report; a start is a host of its own, whose heater is off at first."""
    out, heater, now = np.empty((len(targets), 4)), None, 0.0
    for k, (target, temperature, start) in enumerate(zip(targets.tolist(), temperatures.tolist(), starts.tolist(), strict=True)):
        if start:
            heater, now = heater_of(module, gains), 0.0
            heater.temperature_callback(np.inf, temperature)  # long after the clock began, target 0
            heater.control.prev_temp_time = 0.0
        heater.target_temp = target
        if clock:  # the instants as they are
            now += REPORT_S
            heater.temperature_callback(now, temperature)
        else:  # the last report is at 0: the next one comes to the last digit 0.3 s later
            heater.control.prev_temp_time = 0.0
            heater.next_pwm_time -= REPORT_S
            heater.temperature_callback(REPORT_S, temperature)
        pin, control = heater.mcu_pwm, heater.control
        out[k] = pin.sent, control.prev_temp_deriv, control.prev_temp_integ, pin.count
    return out


def main(folder, given, made):
    module, cases = heaters_of(folder), np.load(given)
    clock = bool(cases["clock"])
    np.savez(made, **{name: run(module, cases[name], cases[f"{name}_target"], cases[f"{name}_temperature"], cases[f"{name}_start"], clock)
                      for name in cases.files if name.isdigit()})


if __name__ == "__main__":
    main(*sys.argv[1:])
