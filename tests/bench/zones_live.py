"""The whole way of n zones on loopback: design, simulate, write, watch, record, and design again from the record.

    python -m tests.bench.zones_live [TARGET PROTOCOL [ZONES]]      default: s7-300 over s7, then weg over modbus, two zones

The heaters are those of `tests.bench.coupled` at a coupling of 1. The PLC holds weaker gains at first. While it is recorded,
the setpoint of one zone after the other is moved. Printed are the verdicts, and the largest distance of the gains and lags
that the record gives from the true ones [%].
"""

import json
import sys
import tempfile
from pathlib import Path

import numpy as np

from heatertune.cli import main
from heatertune.live.client.connection import address_of, connect
from heatertune.live.joint.virtual_zones import virtual_zones
from heatertune.live.joint.zone_blocks import zones_places
from heatertune.live.recorder import RecordingSetup, record
from heatertune.live.serve import Simulation
from heatertune.zones import fit_network, read_zones
from heatertune.zones.zones_folder import read_zones_design
from tests.bench.coupled import GAIN, LAG_S, SETPOINT_DEGC, joint_log

RATE, STEP_DEGC, REST_S = 300.0, 6.0, 1500.0
#: target → its word that scales the power, and how it is weakened
WEAK = {"s7-300": "GAIN", "weg": "Kp", "s5-ob251": "K", "fb41": "GAIN"}


def move_setpoints(places, so_far, last):
    """Write the setpoints of the moment: each zone in turn, one rest up, one rest back."""
    if so_far.last is None:
        return
    phase = int(so_far.last.time_s // REST_S)
    if phase == last[0]:
        return
    last[0] = phase
    zones = len(places.zones)
    for zone, (where, block) in enumerate(zip(places.addresses, places.blocks, strict=True)):
        wanted = SETPOINT_DEGC + (STEP_DEGC if phase % 2 and (phase // 2) % zones == zone else 0.0)
        signal = block.signals["setpoint"]
        with connect(where) as client:
            client.write(where.block or 0, signal.start, signal.bytes_of(wanted))


def way(target, protocol, count=2):
    """Go the whole way and print a line for each step; return whether every step did as it should."""
    names = "abcdefgh"[:count]
    zones = ",".join(names)
    with tempfile.TemporaryDirectory() as place:
        log, folder = joint_log(1.0, place, count), Path(place) / "oven"
        design = ["--zones", zones, "--target", target, "--setpoint", f"{SETPOINT_DEGC:g}", "--quiet"]
        done = [main(["design", str(log), *design, "--out", str(folder)])]
        words = read_zones_design(folder).words
        faults = [f"zone={name} t=3 word {WEAK[target]}={round(0.7 * value) if isinstance(value, int) else 0.7 * value}"
                  for name, value in ((name, own.values[WEAK[target]]) for name, own in zip(names, words, strict=True))]
        settings = Simulation(serve=(protocol,), rate=RATE, faults=tuple(faults))
        with virtual_zones(folder, settings, noise_degC=0.03) as plc:
            address = plc.zone_places()[0]["urls"][protocol]
            plc.plc.wait(1500.0 / RATE)
            digits = json.loads((folder / "data" / "zones.json").read_text())["digest"].partition(":")[2][:8]
            done.append(main(["write", str(folder), address, "--range", "0", "100", "--apply", "--confirm", digits, "--quiet"]))
            done.append(main(["watch", address, "--design", str(folder), "--duration", "1200", "--quiet",
                              "--out", f"{place}/watch.csv"]))
            places, last = zones_places(folder, address_of(address)), [-1]
            recorded = Path(place) / "record.csv"
            record(address_of(address), recorded, places, RecordingSetup(for_s=REST_S * (2 * count + 1)),
                   shown=lambda so_far: move_setpoints(places, so_far, last))
        network = fit_network(read_zones(recorded, names)).network
        off = [100.0 * np.abs(np.array(found) / true - 1.0).max() for found, true in (
            (network.gains_degC_per_pct, GAIN), (network.time_constants_s, LAG_S))]
        again = main(["design", str(recorded), *design, "--out", f"{place}/again"])
        print(f"{target} over {protocol}, {count} zones: design, write, watch {done}; designed again {again}; the record's gains "
              f"within {off[0]:.1f} %, lags within {off[1]:.1f} % of the true ones", flush=True)
    return done == [0, 0, 0] and again == 0


def run(*arguments):
    """Go each way."""
    if arguments:
        return way(arguments[0], arguments[1], *map(int, arguments[2:3]))
    return all([way("s7-300", "s7"), way("weg", "modbus")])


if __name__ == "__main__":
    sys.exit(0 if run(*sys.argv[1:]) else 1)
