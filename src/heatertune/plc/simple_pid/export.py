"""Words → a Python module: simple-pid's object, and a loop that switches the heater in windows of time."""

from __future__ import annotations

from heatertune.plc.parallel.window import PwmWindow, window_of
from heatertune.plc.parallel.words import decimal
from heatertune.plc.words import Certificate, Words

__all__ = ["export_words"]

_MODULE = '''
import math
import time

from simple_pid import PID

SETPOINT_DEGC = {setpoint}
PERIOD_MS = {period}
WINDOW_MS = {window}
STEP_MS = {step}
LEAST_ON_MS = {on}
LEAST_OFF_MS = {off}
{distances}

def controller():
    """Return the controller as it was proven; it has to be called each PERIOD_MS with the interval in seconds."""
    return PID(
        Kp={kp}, Ki={ki}, Kd={kd}, setpoint=SETPOINT_DEGC, sample_time=None,
        output_limits=(0.0, {high}), proportional_on_measurement={p_on}, differential_on_measurement={d_on},
    )


def pulse_ms(output):
    """Return how long the heater is on in one window for an output in percent; what is no number is off."""
    if not output > 0.0:
        return 0
    wanted = output / 100.0 * WINDOW_MS
    on = STEP_MS * math.floor(wanted / STEP_MS + 0.5)
    if min(wanted, on) < LEAST_ON_MS:
        return 0
    return WINDOW_MS if max(wanted, on) > WINDOW_MS - LEAST_OFF_MS else on


{far}def run(read_degC, switch, clock=time.monotonic, sleep=time.sleep):
    """Control for ever; switch(False) in the end, whatever ends it.

    read_degC() returns the temperature, NaN where the sensor is broken; switch(on) puts the heater on or off.
    """
    pid, output, called, due, began, on_ms = None, None, None, clock(), None, 0
    try:
        while True:
            now = clock()
            if now >= due:
                reading = read_degC()
                if math.isnan(reading):  # a broken sensor: off, and from cold when it is back
                    pid, output, began = None, None, None
{boost}                else:
                    pid, dt = (controller(), PERIOD_MS / 1000.0) if pid is None else (pid, now - called)
                    output, called = pid(reading, dt=dt), now
                due = max(due + PERIOD_MS / 1000.0, now)
            if output is None:
                switch(False)
            else:
                if began is None or round(1000.0 * (now - began)) >= WINDOW_MS:
                    began = now if began is None else began + WINDOW_MS / 1000.0
                    on_ms = pulse_ms(output)
                switch(round(1000.0 * (now - began)) < on_ms)
            sleep(STEP_MS / 1000.0)
    finally:
        switch(False)
'''

_FAR = '''\
def far(reading, free):
    """Return whether the heater gets full power, free telling whether no controller has it."""
    return (BOOST_WITHIN_DEGC if free else BOOST_AGAIN_DEGC) < SETPOINT_DEGC - reading < math.inf


'''

_BOOST = '''\
                elif far(reading, pid is None):  # full power, and from cold where the controller takes over
                    pid, output = None, {high}
'''


def export_words(words: Words, certificate: Certificate) -> dict[str, str]:
    """Return the module; the same words and certificate give the same bytes."""
    window, values = window_of(words, certificate), words.values
    setpoint = words.scaling.low_degC if certificate.setpoint_degC is None else certificate.setpoint_degC
    high = decimal(values["output_max"], "LREAL")
    head = "\n".join(f"# {line}" for line in _head(words, certificate, window))
    body = _MODULE.format(
        setpoint=decimal(setpoint, "LREAL"), period=words.whole["PERIOD_MS"], window=window.period_ms,
        step=window.step_ms, on=window.least_on_ms, off=window.least_off_ms,
        kp=decimal(values["Kp"], "LREAL"), ki=decimal(values["Ki"], "LREAL"), kd=decimal(values["Kd"], "LREAL"),
        high=high, p_on=values["proportional_on_measurement"] != 0,
        d_on=values["differential_on_measurement"] != 0, distances=_distances(words),
        far=_FAR if words.boost else "", boost=_BOOST.format(high=high) if words.boost else "")
    return {"simple_pid_heater.py": head + "\n" + body}


def _distances(words: Words) -> str:
    if words.boost is None:
        return ""
    return (f"BOOST_WITHIN_DEGC = {decimal(words.boost.within_degC, 'LREAL')}\n"
            f"BOOST_AGAIN_DEGC = {decimal(words.boost.again_degC, 'LREAL')}\n")


def _head(words: Words, certificate: Certificate, window: PwmWindow) -> tuple[str, ...]:
    scale = words.scaling
    return (
        "heater controller for Python's simple-pid 2.0.1",
        f"sensor {scale.low_degC:g}...{scale.high_degC:g} degC; TA: {words.sample_time_s:g} s; output in percent",
        *certificate.head,
        window.summary,
        "remains to be done by hand: run(read_degC, switch) with your sensor and your heater's switch; pulses end with",
        "  a round of the loop, late by up to STEP_MS and what your reading takes",
    )
