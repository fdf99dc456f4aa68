"""Damaged records of writes: each is told in one line, or what is whole of it is shown; nothing else happens.

    python -m tests.bench.records [RECORDS] [SEED]
"""

import collections
import json
import os
import random
import sys
import tempfile

from heatertune import virtual_plc
from heatertune.cli import main as command
from heatertune.codec import decode, encode
from heatertune.errors import HeatertuneError
from heatertune.live.write.rollback import write_records
from heatertune.proof.difference import WriteHistory
from heatertune.report.as_left_section import writes_brief
from tests.bench.sessions import folder_in

RECORDS = 3000
ODD = (None, True, -1, 1e308, 10**30, "", "x", [], {}, "NaN", 0.5, "2026-11-23", "unknown")
FOUND = ("t=3 word K=3000", "t=3 word TI=30")


def record_in(folder, name="record.jsonl", *, back=True):
    """Return the record of a write into a virtual PLC, and of the way back."""
    path, asked = folder / name, ["--quiet", "--apply", "--yes"]
    yes = json.loads((folder / "data" / "proof.json").read_text())["digest"].partition(":")[2][:8]
    with virtual_plc(folder, serve="s7", rate=1500, faults=FOUND) as plc:
        while plc.status.intervals < 600:  # at rest: what the words found here are swinging up to is no fault of those written
            plc.plc.wait(0.001)
        host, port = plc.addresses["s7"]
        assert command(["write", str(folder), f"s7://{host}:{port}/0/2/db30", "--range", "0", "100", "--record", str(path), *asked,
                        yes]) == 0
        if back:
            before = json.loads(path.read_text().splitlines()[0])["sha256"][:8]
            assert command(["rollback", str(path), *asked, before]) == 0
    return path


def damaged(content, chance):
    """Return a record with one thing wrong."""
    lines = content.split(b"\n")
    number = chance.randrange(len(lines) - 1)
    kind = chance.choice(("byte", "cut", "lines", "field", "field", "gone"))
    if kind == "byte":
        at = chance.randrange(len(content))
        return content[:at] + bytes([chance.randrange(256)]) + content[at + 1:]
    if kind == "cut":
        return content[:chance.randrange(len(content))]
    if kind == "lines":
        other = chance.randrange(len(lines) - 1)
        lines[number], lines[other] = lines[other], lines[number]
        return b"\n".join(lines)
    if kind == "gone":
        return b"\n".join(lines[:number] + lines[number + chance.choice((1, 1, 5)):])
    line = json.loads(lines[number])
    name = chance.choice(list(line))
    line[name] = chance.choice(ODD)
    if chance.random() < 0.3:
        del line[name]
    lines[number] = json.dumps(line).encode()
    return b"\n".join(lines)


def became(content, folder):
    """Return what became of a record: "shown", or the first words of the error; anything else is raised."""
    path = folder / "damaged.jsonl"
    path.write_bytes(content)
    try:
        found = write_records([path], folder)
    except HeatertuneError as problem:
        said = str(problem)
    else:
        said = ""
    if said:
        assert "\n" not in said, said
        assert path.name in said, said
        return "told"
    document = encode(found)
    assert decode(WriteHistory, json.loads(json.dumps(document, allow_nan=False)), "written.json") == found
    assert writes_brief(document, "report.html")
    return "shown"


def main(records=RECORDS, seed=0):
    """Damage a record so often."""
    with tempfile.TemporaryDirectory() as place:
        os.environ["HEATERTUNE_STATE"] = place
        folder = folder_in(place)
        content, chance = record_in(folder).read_bytes(), random.Random(seed)
        print(collections.Counter(became(damaged(content, chance), folder) for _ in range(records)))


if __name__ == "__main__":
    main(*map(int, sys.argv[1:]))
