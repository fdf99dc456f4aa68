"""What an exported program says first: what it is, under which conditions, and what remains to be done by hand."""

from __future__ import annotations

from collections.abc import Sequence

from heatertune.plc.st.program import ProgramClock
from heatertune.plc.words import Certificate, Words

__all__ = ["by_hand", "head_of"]


def head_of(
    title: str, words: Words, interval_ms: int, certificate: Certificate, clock: ProgramClock, *,
    tool: str = "a vendor's tool",
) -> tuple[str, ...]:
    """Return what an exported text says first.

    Args:
        title: what it is.
        words: that it holds.
        interval_ms: at which the block is called [ms].
        certificate: of their proof.
        clock: of the program.
        tool: in which it was not tried.
    """
    scale = words.scaling
    pwm = f"no PWM in the program: {clock.reason}"
    if clock.steps:
        pwm = f"PWM in the program, steps of {clock.tick_ms} ms"
    return (
        title,
        f"sensor {scale.low_degC:g}...{scale.high_degC:g} degC; TA: called every {interval_ms} ms; output in percent; "
        f"{pwm}",
        *certificate.head,
        f"not tried in {tool}",
    )


def by_hand(
    clock: ProgramClock, certificate: Certificate, *, of_clock: Sequence[str] = (), of_start: Sequence[str] = ()
) -> list[str]:
    """Return what remains to be done by hand, numbered.

    Args:
        clock: of the program.
        certificate: of the proof.
        of_clock: what a block adds to the steps of the clock.
        of_start: to those of the start-up.
    """
    wired = "HeaterOutput" if clock.steps else "HeaterPower, through a PWM of yours as it was proven,"
    exact = f"; a scan longer than {clock.tick_ms} ms makes coarser pulses than were proven" if clock.steps else ""
    loaded = "the lowest" if certificate.setpoint_degC is None else "as proven"
    steps = (
        f"wire HeaterOn and HeaterTemperature (degC) to your inputs and {wired} to the heater's switch; HeaterOn must "
        "fall when the sensor breaks: that puts the heater off",
        f"ScanMs is the time of one scan: call the program from a task of {clock.tick_ms} ms, or write the time of the "
        f"last scan there each scan{exact}",
        *of_clock,
        "leave the variables and the block without retention: each start-up is from cold then, as proven",
        *of_start,
        f"setpoint: HeaterSetPoint begins {loaded}; another one is not proven",
    )
    return ["remains to be done by hand:", *(f"  {number}. {step}" for number, step in enumerate(steps, start=1))]
