"""Does a virtual PLC, and a recorder as a service next to it, take more memory, descriptors or threads with time?

    python -m tests.bench.soak [MINUTES [SEED [FIGURES.json]]]

`simulate` serves S7, Modbus and OPC UA in a process of its own, `record --service` reads it in another. Meanwhile a
third connects and reads as clients do, sends packets that are none, streams bytes that never make a message, and
leaves connections open without a word. Memory, descriptors and threads are the kernel's own figures (/proc). Ends with
status 1 where one of them grows behind the first sixth of the time, where either process writes to the screen, or where
the virtual PLC no longer answers.
"""

import contextlib
import json
import logging
import os
import random
import socket
import struct
import subprocess
import sys
import tempfile
import time
from pathlib import Path

from asyncua.sync import Client as OpcuaClient
from snap7.client import Client as S7Client

from tests.bench.sessions import folder_in

#: of the resident memory, behind the first sixth [KB]: what the allocator does by itself
SLACK_KB = 4096
EVERY_S = 10.0


def figures(process):
    """Return memory [KB], descriptors and threads of a process, as the kernel counts them."""
    status = dict(line.split(":", 1) for line in Path(f"/proc/{process}/status").read_text().splitlines())
    return {"memory_KB": int(status["VmRSS"].split()[0]), "threads": int(status["Threads"]),
            "descriptors": len(list(Path(f"/proc/{process}/fd").iterdir()))}


def hello(host, port):
    """Return OPC UA's first message (OPC 10000-6, section 7.1.2.3)."""
    url = f"opc.tcp://{host}:{port}/".encode()
    body = struct.pack("<IIIIIi", 0, 65535, 65535, 0, 0, len(url)) + url
    return b"HELF" + struct.pack("<I", 8 + len(body)) + body


def malformed(protocol, where, chance):
    """Return bytes that are no message of a protocol, or only its beginning."""
    rubbish = chance.randbytes(chance.randrange(1, 400))
    if protocol == "opcua":
        head = chance.choice([b"HELF", b"OPNF", b"MSGF", b"MSGC", b"CLOF", b"XXXF", b"HELLO"])
        first = chance.choice([b"", hello(*where)])
        return first + head + struct.pack("<I", chance.choice([0, 7, 8, 60, 400, 2**31 - 1, 2**32 - 1])) + rubbish
    if protocol == "modbus":
        return struct.pack(">HHHB", 1, chance.choice([0, 5]), chance.choice([0, 1, 6, 400, 65535]), 1) + rubbish
    return struct.pack(">BBH", chance.choice([3, 0]), 0, chance.choice([0, 3, 4, 7, 22, 400, 65535])) + rubbish


def read_well(protocol, where):
    """Read the block as a client does, with its library alone."""
    host, port = where
    if protocol == "modbus":
        with socket.create_connection(where, 5) as link:
            link.sendall(struct.pack(">HHHBBHH", 9, 0, 6, 1, 3, 0, 20))
            answer = b""
            while len(answer) < 49:
                more = link.recv(49 - len(answer))
                assert more, "no answer"
                answer += more
        return
    if protocol == "s7":
        client = S7Client()
        client.connect(host, 0, 2, port)
        assert len(client.db_read(30, 0, 98)) == 98
        client.disconnect()
        return
    client = OpcuaClient(f"opc.tcp://{host}:{port}/", timeout=10)
    client.connect()
    assert len(client.get_node("ns=2;s=DB30").read_value()) == 98
    client.disconnect()


def stream(where, begin, chance):
    """Send up to 4 MB that never make a message."""
    with socket.create_connection(where, 5) as link, contextlib.suppress(OSError):
        link.sendall(begin)
        for _ in range(32):
            link.sendall(chance.randbytes(1 << 17))


def one_round(addresses, chance, silent):
    """Do what clients do, well and badly."""
    for protocol, where in addresses.items():
        read_well(protocol, where)
        for _ in range(20):
            with socket.create_connection(where, 5) as link, contextlib.suppress(OSError):
                link.sendall(malformed(protocol, where, chance))
                if chance.random() < 0.3:
                    link.setsockopt(socket.SOL_SOCKET, socket.SO_LINGER, struct.pack("ii", 1, 0))
                link.settimeout(0.02)
                link.recv(100)
        stream(where, malformed(protocol, where, chance), chance)
        if chance.random() < 0.5:
            silent.append((time.monotonic(), socket.create_connection(where, 5)))
    while silent and (len(silent) > 12 or time.monotonic() - silent[0][0] > 120.0):
        silent.pop(0)[1].close()


def soak(minutes, seed, place, told=print, path=None):
    """Run it; return what is wrong."""
    chance, out, rows = random.Random(seed), folder_in(place), []
    errors = [(place / name).open("w+") for name in ("simulate.txt", "record.txt")]
    state = {**os.environ, "HEATERTUNE_STATE": str(place / "state")}
    line = [sys.executable, "-m", "heatertune"]
    simulate = subprocess.Popen([*line, "simulate", str(out), "--serve", "s7", "--serve", "modbus", "--serve", "opcua", "--rate", "20",
                                 "--json"], stdout=subprocess.PIPE, stderr=errors[0], text=True, env=state)
    said = ""
    while not said.endswith("\n}\n"):
        said += simulate.stdout.readline()
        assert simulate.poll() is None
    found = json.loads(said)["addresses"]
    addresses = {name: (each["host"], each["port"]) for name, each in found.items()}
    record = subprocess.Popen([*line, "record", found["modbus"]["url"], "--design", str(out), "-o", str(place / "log.csv"), "--service",
                               "--quiet", "--interval", "0.2"], stdout=errors[1], stderr=errors[1], env=state)
    processes, silent, rounds, begun = {"simulate": simulate, "record": record}, [], 0, time.monotonic()
    try:
        while (passed := time.monotonic() - begun) < 60.0 * minutes:
            one_round(addresses, chance, silent)
            rounds += 1
            assert all(each.poll() is None for each in processes.values()), "a process has ended"
            if not rows or passed - rows[-1]["s"] >= EVERY_S:
                rows.append({"s": passed, **{name: figures(each.pid) for name, each in processes.items()}})
                if path is not None:
                    path.write_text(json.dumps({"rounds": rounds, "rows": rows}, indent=1))
            time.sleep(0.5)
    finally:
        for _, each in silent:
            each.close()
        for each in processes.values():
            each.terminate()  # a shell that starts this behind it has programs ignore SIGINT
            each.wait()
    told(f"{rounds} rounds in {time.monotonic() - begun:.0f} s, {60 * rounds} malformed packets, {12 * rounds} MB streamed at most")
    return judged(processes, rows, errors, told)


def judged(processes, rows, errors, told):
    """Return what grows, and who writes to the screen."""
    wrong = []
    for name in processes:
        for what, slack in (("memory_KB", SLACK_KB), ("descriptors", 12), ("threads", 12)):
            seen = [row[name][what] for row in rows]
            first, last = max(seen[len(seen) // 6 : len(seen) // 3] or seen), max(seen[-max(1, len(seen) // 6):])
            told(f"{name} {what}: {seen[0]} at first, at most {first} in the second sixth, at most {last} in the last")
            if last > first + slack:
                wrong.append(f"{name}: {what} grows from {first} to {last}")
    for each in errors:
        each.seek(0)
        lines = each.read().splitlines()
        told(f"{each.name}: {len(lines)} lines")
        if len(lines) > 5:
            wrong.append(f"{each.name}: {len(lines)} lines, as {lines[-1]!r}")
        each.close()
    return wrong


def quiet():
    """Keep the library that reads here off the screen."""
    logging.getLogger("asyncua").addHandler(logging.NullHandler())


def main(minutes=60, seed=1, path=None):
    """Print the figures; return 1 where something grows."""
    quiet()
    with tempfile.TemporaryDirectory() as place:
        wrong = soak(float(minutes), int(seed), Path(place), path=path and Path(path))
    for each in wrong:
        print("WRONG:", each)
    return int(bool(wrong))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
