"""A machine that runs the statements of a STEP 5 listing, from the S5-115U's list of operations; it refuses any other.

L loads ACCU 1 and pushes what was there to ACCU 2; +F and -F put ACCU 2 ± ACCU 1 into ACCU 1; a comparison sets RLO to
ACCU 2 … ACCU 1; JC jumps and BEC ends where RLO is 1; TAK swaps the accumulators.
"""

import operator

COMPARE = {">F": operator.gt, ">=F": operator.ge, "<F": operator.lt, "<=F": operator.le, "!=F": operator.eq}
SUM = {"+F": 1, "-F": -1}


def blocks(listing):
    """Return the statements of the listing's blocks, each (label, operation), comments and heads left out."""
    found = [[]]
    for line in listing.splitlines():
        if not line:
            found.append([])
        elif ":" in line and not line.startswith(("//", "NAME")):
            label, _, operation = line.partition(":")
            found[-1].append((label.strip(), " ".join(operation.split())))
    return found


def run(block, memory):
    """Run a block on the memory: "DW 9", "FW 200" … → word."""
    one = two = 0
    rlo, place = False, 0
    labels = {label: number for number, (label, _) in enumerate(block) if label}
    while place < len(block):
        name, _, operand = block[place][1].partition(" ")
        place += 1
        if name == "L":
            one, two = int(operand.removeprefix("KF ")) if operand.startswith("KF") else memory[operand], one
        elif name == "T":
            memory[operand] = one
        elif name in SUM:
            one = two + SUM[name] * one
            assert -32768 <= one <= 32767, "a word would overflow"
        elif name in COMPARE:
            rlo = COMPARE[name](two, one)
        elif name == "TAK":
            one, two = two, one
        elif name in ("JC", "JU"):
            place = labels[operand.removeprefix("=")] if rlo or name == "JU" else place
        elif name in ("BE", "BEC"):
            if rlo or name == "BE":
                return
        else:
            assert (name, operand) == ("C", "DB 30"), f"{name} {operand} is not known here"
