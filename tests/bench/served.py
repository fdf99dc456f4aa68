"""Ten thousand scans of each served controller twice on each protocol: the same bytes, the proof's own run, and how many a second.

    python -m tests.bench.served [SCANS [PROTOCOL …]]
"""

import sys
import time
from dataclasses import replace

from heatertune import Fopdt, Scenario, model_by_hand, simulate, virtual_plc
from heatertune.live import as511_server as as511
from heatertune.live.controller_block import SERVED, block_for
from heatertune.live.simulator_status import SimulatorStatus
from heatertune.plc import controller_for
from tests.live.conftest import CLIENTS, CONDITIONS, stepped, words_of

_SCANS = 10_000
_MOST = 200  # bytes that one request reads over either protocol


def run(protocol, words, heater, scans):
    """Return both blocks after each scan, and scans a second; of registers that are not in a row the simulator's block alone."""
    noisy = replace(CONDITIONS, noise_degC=0.3)
    with virtual_plc(words, heater, noisy, serve=protocol, step=True) as plc:
        asking = CLIENTS[protocol](*plc.addresses[protocol])
        in_a_row = [run.first for run in plc.registers] == [0]
        begun = time.monotonic()
        rows = stepped(asking, scans, block=(plc.number, plc.length) if in_a_row and plc.length <= _MOST else None)
        took = time.monotonic() - begun
        asking.close()
    return rows, scans / took


def main(scans, protocols):
    """Print one line for each controller and protocol; end with status 1 where a run differs."""
    heater = model_by_hand(Fopdt(gain_degC_per_pct=0.9, time_constant_s=167.0, dead_time_s=12.0, ambient_degC=22.0))
    wrong = 0
    as511.SILENCE_S = 60.0  # a busy machine is no silence
    for target in SERVED:
        words, controller = words_of(target), controller_for(target)
        story = Scenario(setpoint_degC=50.0, duration_s=(scans - 1) * controller.timing(words).scan_s, noise_degC=0.3)
        proven = simulate(words, heater, story).power_asked_pct[:scans].tolist()
        for protocol in set(block_for(controller, words, {}).speaks) & set(protocols):
            (first, rate), (second, _) = (run(protocol, words, heater, scans) for _ in range(2))
            unlike = sum(one != other for one, other in zip(first, second, strict=True))
            apart = sum(SimulatorStatus(own).power_pct != asked for (own, _), asked in zip(first, proven, strict=True))
            print(f"{target:16}{protocol:8}{scans} scans twice: {unlike} differ; from the proof's run: {apart}; {rate:.0f} scans/s")
            wrong += unlike + apart
    return int(wrong > 0)


if __name__ == "__main__":
    sys.exit(main(int(sys.argv[1]) if len(sys.argv) > 1 else _SCANS, sys.argv[2:] or CLIENTS))
