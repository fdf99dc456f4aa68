"""Ten thousand scans of a served PLC twice on each protocol: the same bytes, the proof's own run, and how many a second.

    python -m tests.bench.served [SCANS [PROTOCOL …]]
"""

import sys
import time
from dataclasses import replace

from heatertune import Fopdt, Scenario, model_by_hand, simulate, virtual_plc
from heatertune.live import as511
from heatertune.live.memory import Told
from tests.live.conftest import CLIENTS, CONDITIONS, stepped, words_of

_SCANS = 10_000


def run(protocol, words, heater, scans):
    """Return both blocks after each scan, and scans a second."""
    noisy = replace(CONDITIONS, noise_degC=0.3)
    with virtual_plc(words, heater, noisy, serve=protocol, step=True) as plc:
        asking = CLIENTS[protocol](*plc.addresses[protocol])
        begun = time.monotonic()
        rows = stepped(asking, scans)
        took = time.monotonic() - begun
        asking.close()
    return rows, scans / took


def main(scans, protocols):
    """Print one line for each protocol; end with status 1 where a run differs."""
    words = words_of("s5-ob251")
    heater = model_by_hand(Fopdt(gain_degC_per_pct=0.9, time_constant_s=167.0, dead_time_s=12.0, ambient_degC=22.0))
    story = Scenario(setpoint_degC=50.0, duration_s=(scans - 1) * words.sample_time_s, noise_degC=0.3)
    proven = simulate(words, heater, story).power_asked_pct[:scans].tolist()
    wrong = 0
    as511.SILENCE_S = 60.0  # a busy machine is no silence
    for protocol in protocols:
        (first, rate), (second, _) = (run(protocol, words, heater, scans) for _ in range(2))
        unlike = sum(one != other for one, other in zip(first, second, strict=True))
        apart = sum(Told(own).power_pct != asked for (own, _), asked in zip(first, proven, strict=True))
        print(f"{protocol:8}{scans} scans twice: {unlike} differ; from the proof's run: {apart}; {rate:.0f} scans/s")
        wrong += unlike + apart
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else _SCANS, sys.argv[2:] or CLIENTS))
