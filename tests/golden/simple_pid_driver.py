"""Runs simple-pid's own class on calls given as arrays: `python simple_pid_driver.py FOLDER IN.npz OUT.npz`."""

import sys

import numpy as np

sys.path.insert(0, sys.argv[1])
from simple_pid import PID

given = np.load(sys.argv[2])
made = {}
for key in {name for name in given.files if "_" not in name}:
    kp, ki, kd, high, p_on, d_on = given[key].tolist()
    pid = PID(kp, ki, kd, sample_time=None, output_limits=(0.0, high), proportional_on_measurement=bool(p_on),
              differential_on_measurement=bool(d_on))
    outputs = []
    for setpoint, reading, auto, last, dt in given[f"{key}_calls"].tolist():
        if bool(auto) != pid.auto_mode:
            pid.set_auto_mode(bool(auto), last_output=last)
        pid.setpoint = setpoint
        output = pid(reading, dt=dt)
        outputs.append(0.0 if output is None else output)
    made[key] = np.array(outputs)
np.savez(sys.argv[3], **made)
