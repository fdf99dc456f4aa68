"""Whether two judges see the same of a run, and whether what they see otherwise is a close call.

Values may differ by 1e-5 of themselves or of their limit, ten thousand times what the two ways of integration mostly do
(their median is 3e-10); switchings by 0.5 %, saturation by 0.05 % of all scans: one of thousands of scans, and of hundreds
of pulses, begins at the very end of a story, which the program counts alone, and a power that is at its limit but for the
last digit of a double is so for one judge alone. A limit that lies between two such values is a close call. Readings are
counts, so a heater other by 1e-9 may be switched a scan later: what differs by more is a close call, too, where the second
judge gives both answers itself, and values as far apart as the two are, of heaters whose gain is other by 1e-9 to 3e-8, or
of an instrument whose band is other by 1e-12: errors and band are tenths of a degree, and often the same.
"""

import math
from dataclasses import replace

from tests.bench.second_opinion import opinion

SLACK = 1e-5
COUNTED = {"saturation": 5e-4, "switchings": 5e-3}
_HAIR = 1e-9
_LAST_DIGITS = 1e-12
_HAIRS = (-30, -10, -3, -1, 1, 3, 10, 30)
_SAME = {"power_reserve": "power held"}  # by its other side


def told(library, bench, limits):
    """Return name → (value, limit) of all that the second judge looks at."""
    return opinion(library, bench, limits, longer=0.0).values


def named(values):
    """Return the program's values by the judge's names; numbers or arrays."""
    return {_SAME.get(name, name): 100.0 - value if name in _SAME else value for name, value in values.items()}


def keeps(values):
    """Return whether every limit is kept."""
    return all(value <= limit for value, limit in values.values())


def near(name, one, other, limit):
    """Return whether two values of a criterion are the same but for what measures may differ by."""
    scale = max(abs(one), abs(other), 0.0 if math.isinf(limit) else limit, 100.0 if name == "saturation" else 0.0)
    return one == other or abs(one - other) <= COUNTED.get(name, SLACK) * scale


def apart(values, mine):
    """Return name → (program's, the judge's, limit) of what differs between them."""
    return {name: (values[name], value, limit) for name, (value, limit) in mine.items()
            if name in values and not near(name, values[name], value, limit)}


def differ(values, kept, mine):
    """Return whether the program and the judge see the limits kept otherwise, and it is no close call."""
    if kept == keeps(mine):
        return False
    return not any(math.isclose(values.get(name, value), limit, rel_tol=SLACK) and math.isclose(value, limit, rel_tol=SLACK)
                   for name, (value, limit) in mine.items() if not math.isinf(limit) and limit > 0.0)


def by_a_hair(library, bench, limits, values, kept):
    """Return whether the judge itself, of heaters other by next to nothing, is as far from itself as the program is from it."""
    benches = [replace(bench, gain=bench.gain * (1.0 + hair * _HAIR)) for hair in (0, *_HAIRS)]
    if bench.target == "pband":
        benches += [replace(each, words=each.words | {"Pb": each.words["Pb"] * (1.0 + way * _LAST_DIGITS)})
                    for way in (-1.0, 1.0) for each in benches]
    mine, *others = (told(library, each, limits) for each in benches)
    ends = {name: [each[name][0] for each in (mine, *others)] for name in mine}

    def within(name, theirs, limit):
        low, high = min(ends[name]), max(ends[name])
        return low <= theirs <= high or near(name, theirs, low, limit) or near(name, theirs, high, limit)

    verdicts = {keeps(each) for each in (mine, *others)}
    return (not differ(values, kept, mine) or kept in verdicts) and all(
        within(name, theirs, limit) for name, (theirs, _, limit) in apart(values, mine).items())
