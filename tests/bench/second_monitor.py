"""A second monitor, written from the numbers that `heatertune supervise` tells and what they mean: many heaters at once.

It shares no line with `heatertune.supervision`: whole records instead of rings, arrays instead of counters.
"""

import numpy as np

NAMES = ("none", "sensor gone", "implausible rate", "frozen", "heats too slowly", "falls although heated", "too hot for its power",
         "setpoint out of reach", "swing grows")


class Monitors:
    """n monitors with the same numbers; feed them a scan at a time."""

    def __init__(self, numbers, n):
        self.by, self.n = dict(numbers), n
        self.again()

    def again(self):
        """Begin anew, as after a start-up."""
        zeros = lambda: np.zeros(self.n, dtype=np.int64)  # noqa: E731
        self.scans, self.last = 0, None
        self.same, self.since_moved, self.full, self.held = zeros(), zeros(), zeros(), zeros()
        self.level, self.power = zeros(), zeros()
        self.levels, self.powers = [], []
        self.way, self.top, self.bottom = zeros(), None, None
        self.swing, self.grown = zeros(), zeros()

    def feed(self, reading, power):
        """Return the alarm of each after a scan, 0 for none; reading and power are whole numbers, shape (n,)."""
        by, alarm = self.by, np.zeros(self.n, dtype=np.int64)
        self.full = np.where(power >= 100, self.full + 1, 0)
        if self.last is None:
            moved, same = np.zeros(self.n, dtype=np.int64), np.zeros(self.n, dtype=bool)
        else:
            moved = reading - self.last
            same = moved == 0
        self.held = np.where(same, self.held, power)
        self.same = np.where(same, self.same + 1, 0)
        begun = (self.since_moved > 0) | (np.abs(power - self.held) >= by["moved"])
        self.since_moved = np.where(same & begun, self.since_moved + 1, 0)
        if by["full"]:
            alarm[self.full > by["full"]] = 7
        if by["still"]:
            alarm[self.same > by["still"]] = 3
        if by["still_moved"]:
            alarm[self.since_moved > by["still_moved"]] = 3
        alarm[np.abs(moved) > by["jump"]] = 2
        alarm[(reading < by["low"]) | (reading > by["high"])] = 1
        self.last = reading.copy()
        self.level, self.power, self.scans = self.level + reading, self.power + power, self.scans + 1
        if self.scans % by["block"] == 0:
            self.levels, self.powers = [*self.levels[-99:], self.level], [*self.powers[-99:], self.power]
            self.level, self.power = self.level * 0, self.power * 0
            told = self._block()
            alarm = np.where(alarm == 0, told, alarm)
        return alarm

    def _block(self):
        by, alarm = self.by, np.zeros(self.n, dtype=np.int64)
        if by["growths"]:
            self._swings()
            alarm[self.grown >= by["growths"]] = 8
        for which, number in (("slow", 4), ("fast", 6)):
            window = by[f"{which}_blocks"]
            if not window or len(self.levels) <= window + by["delay_high"]:
                continue
            before = self.levels[-1 - window]
            moved = self.levels[-1] - before
            sums = [sum(self.powers[len(self.powers) - delay - window:len(self.powers) - delay])
                    for delay in range(by["delay_low"], by["delay_high"] + 1)]
            power = np.min(sums, axis=0) if which == "slow" else np.max(sums, axis=0)
            limit = by[f"{which}_gain"] * power - by[f"{which}_loss"] * before + by[f"{which}_rest"]
            if which == "slow":
                low = by["slow_scale"] * moved < limit
                alarm[low] = np.where(moved <= -by["swing"], 5, 4)[low]
            else:
                alarm[by["fast_scale"] * moved > limit] = number
        return alarm

    def _swings(self):
        level, least = self.levels[-1], self.by["swing"]
        if self.top is None:
            self.top, self.bottom = level.copy(), level.copy()
        # way 0: no turn yet; 1: rising from bottom, top is the highest since; -1: the mirror image
        top, bottom = self.top.copy(), self.bottom.copy()
        up, down, none = self.way == 1, self.way == -1, self.way == 0
        top[(up | none) & (level > top)] = level[(up | none) & (level > top)]
        bottom[(down | none) & (level < bottom)] = level[(down | none) & (level < bottom)]
        falls = (up | none) & (level <= top - least)
        rises = ~falls & (down | none) & (level >= bottom + least)
        for turns, was in ((falls & up, 1), (rises & down, -1)):
            del was
            swung = top - bottom
            self.grown[turns] = np.where((self.swing[turns] > 0) & (swung[turns] > self.swing[turns]), self.grown[turns] + 1, 0)
            self.swing[turns] = swung[turns]
        bottom[falls], top[rises] = level[falls], level[rises]
        self.way[falls], self.way[rises] = -1, 1
        self.top, self.bottom = top, bottom
