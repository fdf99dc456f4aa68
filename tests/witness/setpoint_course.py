"""The setpoint word call after call, for tests of programs that lead it."""

from heatertune.plc.ramp import next_setpoint


def course(ramp, readings, asked):
    """Return the setpoint word at each call of the controller; without a ramp it is what is asked for from the first.

    Args:
        ramp: None: none.
        readings: at each call; after the restart the word is the first of them.
        asked: where it goes to.
    """
    if ramp is None:
        return [asked] * len(readings)
    word, followed = readings[0], []
    for call, reading in enumerate(readings, start=1):
        word = next_setpoint(word, asked, ramp, reading, due=call % ramp.calls == 0)
        followed.append(word)
    return followed
