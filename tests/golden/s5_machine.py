"""An S5-115U that runs the statements of a STEP 5 listing, from the list of operations and OB251's own equations.

It knows nothing of heatertune: S5-100U manual EWA 4NEB 812 6120, chapter 8 (operations), S5-115U manual 4NEB 811 6130,
section 11.2.3 (OB251), and refuses whatever else a listing may hold. Words are whole, −32768…32767; of DW18 to DW48 only
OB251 knows what is in them, as in the CPU.

L loads ACCU 1 and pushes what was there to ACCU 2; +F and -F put ACCU 2 ± ACCU 1 into ACCU 1; a comparison sets RLO to
ACCU 2 … ACCU 1; JC jumps and BEC ends where RLO is 1; TAK swaps the accumulators; SRW and SLW shift ACCU 1 as 16 bits.
A block that was called gives its caller's data block back.
"""

import re

COMPARE = {">F": ">", ">=F": ">=", "<F": "<", "<=F": "<=", "!=F": "==", "><F": "!="}
#: a jump reaches 127 words; these take two, as do constants and bit operations on data
LONG = ("JU OB", "JU FB", "TB", "SU", "RU")
#: parameters of FB242, 16 times 16 bits, each a word behind its call
MULTIPLIER = ("Z1", "Z2", "Z3=0", "Z32", "Z31")


class Controller:
    """OB251 on the data block that is open, by the manual's equations; what it keeps is in the words that the 928B names."""

    def __init__(self, limited=False, same_call=False, inward=False, whole=False, beyond=False):
        """What the manual leaves open in automatic, each a switch."""
        self.limited, self.same_call, self.inward, self.whole, self.beyond = limited, same_call, inward, whole, beyond

    def __call__(self, dw):
        """One call."""
        steu = dw[11]
        if steu & 4:
            dw[18:49] = [0] * 31
            return
        k, r, ti = dw[1] / 1024, dw[3] / 1024, dw[5] / 1024
        xw = dw[9] - dw[22]
        pw = xw - dw[38]
        if steu & 1:
            self._automatic(dw, k, r * pw, ti * xw, 0.5 * (dw[7] * (pw - dw[40]) + dw[36]))
        else:
            self._manual(dw)
        dw[38], dw[40] = xw, pw

    def _automatic(self, dw, k, p, i, d):
        def side(y):
            if self.beyond:
                return 1 if y > dw[14] else -1 if y < dw[16] else 0
            return 1 if y >= dw[14] else -1 if y <= dw[16] else 0

        def summed(increment):
            return dw[44] + (int(increment) if self.whole else increment)

        at = side(summed(k * (p + i + d))) if self.same_call else dw[20]
        held = at * k * i > 0 if self.inward else at != 0
        y = summed(k * (p + d) if held else k * (p + i + d))
        limited = max(dw[16], min(dw[14], y))
        dw[48], dw[20], dw[18] = int(limited), side(y), 0
        dw[44], dw[36] = limited if self.limited else y, d

    def _manual(self, dw):
        """To YH within four calls, halving the way and cutting; then it follows YH at once."""
        dw[18] = min(dw[18] + 1, 4)
        wanted = dw[12] if dw[18] == 4 else int((dw[48] + dw[12]) / 2)
        dw[48] = dw[44] = max(dw[16], min(dw[14], wanted))
        dw[36] = dw[20] = 0


def loaded(listing):
    """Return the listing's code blocks, "FB 30" → statements (label, operation, operand), and data blocks, number → words."""
    code, data, block = {}, {}, None
    for line in listing.splitlines():
        if not line or line.startswith(("//", "NAME :")):
            continue
        if head := re.fullmatch(r"(OB|FB) (\d+)", line):
            block = code[head[0]] = []
        elif head := re.fullmatch(r"DB(\d+)", line):
            block = data[int(head[1])] = []
        elif word := re.match(r" *(\d+):  (K. = [^;]+);", line):
            assert int(word[1]) == len(block), "a data word is left out"
            block.append(constant(word[2].replace(" =", "")))
        else:
            label, operation, operand = re.fullmatch(r"(.{5}):(\S+) *([^;]*?) *(?:;.*)?", line).groups()
            if label.strip() in MULTIPLIER:
                block[-1] = block[-1][0], "JU MUL:16", f"{block[-1][2]} {operation} {operand}"
            else:
                block.append((label.strip(), operation, operand))
    for block in code.values():
        reached(block)
    return code, data


def constant(text):
    """Return the word of a constant."""
    kind, *value = text.split()
    if kind == "KM":
        return signed(int("".join(value), 2))
    number = int(value[0], 16 if kind == "KH" else 10)
    low, high = {"KF": (-32768, 32767), "KB": (0, 255), "KH": (0, 65535)}[kind]
    assert low <= number <= high, text
    return signed(number)


def signed(word):
    """Return 16 bits as a number."""
    return ((word & 0xFFFF) ^ 0x8000) - 0x8000


def reached(block):
    """Refuse a block whose jumps go too far or nowhere, or that does not end with BE."""
    places, words = {}, 0
    for label, name, operand in block:
        assert label not in places or not label, f"{label} stands twice"
        assert len(label) <= 4, label
        places[label] = words
        words += length(name, operand)
    words = 0
    for _, name, operand in block:
        if operand.startswith("="):
            assert abs(places[operand[1:]] - words) <= 127, f"{name} {operand} jumps too far"
        words += length(name, operand)
    assert [name for _, name, _ in block].index("BE") == len(block) - 1


def length(name, operand):
    """Return the words of a statement."""
    if name == "JU MUL:16":
        return 2 + len(MULTIPLIER)
    return 2 if operand.startswith("K") or f"{name} {operand}".startswith(LONG) else 1


class Machine:
    """A CPU with a program, which is turned into Python, one line a statement.

    `data` are its data blocks, `inputs` the names of inputs that are 1, `read` gives a word of the periphery by its name
    ("PW 128"), `written` holds what was written there, and to system data ("RS 97").
    """

    def __init__(self, listing, read=None, controller=None, wraps=False):
        """`wraps`: a sum that leaves its word is one modulo 65536, as the CPU has it, and no mistake of the listing."""
        code, self.data = loaded(listing)
        self.inputs, self.written, self.open = set(), {}, None
        self.read = dict.fromkeys(("PW 128",), 0).get if read is None else read
        self.controller = Controller() if controller is None else controller
        self.code = {name: translated(block, wraps) for name, block in code.items()}

    def call(self, name):
        """Run a block until it ends; OB251 is the controller."""
        if name == "OB 251":
            self.controller(self.data[self.open])
            return
        opened = self.open
        self.code[name](self)
        self.open = opened


#: operation and kind of operand → its line; {v} is the operand's number or word, {b} its bit, {o} the operand as it stands
LINES = {
    "L DW": "one, two = data[{v}], one", "T DW": "data[{v}] = one", "L K": "one, two = {v}, one",
    "L PW": "one, two = signed(cpu.read({o!r})), one", "T PW": "cpu.written[{o!r}] = one", "T RS": "cpu.written[{o!r}] = one",
    "T PY": "cpu.written[{o!r}] = one & 0xFF", "TAK": "one, two = two, one", "+F": "one = summed(two, one)",
    "-F": "one = summed(two, -one)", "SRW": "one = signed((one & 0xFFFF) >> {v})", "SLW": "one = signed(one << {v})",
    "C DB": "cpu.open = {v}; data = cpu.data[{v}]", "A I": "rlo = {o!r} in cpu.inputs", "TB D": "rlo = bool(data[{v}] & {b})",
    "SU D": "data[{v}] = signed(data[{v}] | {b})", "RU D": "data[{v}] = signed(data[{v}] & ~{b})",
    "JU OB": "cpu.call({o!r})", "JU FB": "cpu.call({o!r})", "JU MUL:16": "multiplied(data, {o!r})", "JU": "at = {v}; continue", "BE": "return",
    "JC": "if rlo: at = {v}; continue", "BEC": "if rlo: return",
    **{name: f"rlo = two {sign} one" for name, sign in COMPARE.items()},
}


def summed(one, other):
    """Return a sum that a word holds."""
    assert -32768 <= one + other <= 32767, "a word would overflow"
    return one + other


def multiplied(data, operands):
    """FB242: high and low word of a product."""
    number, *given = operands.removeprefix("FB ").split()
    one, two, bit, high, low = (int(float(each)) for each in given[1::2])
    assert (number, given[::2], bit >= 200) == ("242", ["DW", "DW", "F", "DW", "DW"], True), operands
    product = data[one] * data[two]
    data[high], data[low] = product >> 16, signed(product)


def translated(block, wraps=False):
    """Return a function that runs a block, a stretch from each label to the next; an A begins a new logic operation."""
    labels = [label for label, _, _ in block if label]
    lines = ["def run(cpu):", " one = two = at = 0", " rlo, data = False, cpu.data.get(cpu.open)", " while True:", "  if at <= 0:"]
    for number, (label, name, operand) in enumerate(block):
        if label:
            lines.append(f"  if at <= {labels.index(label) + 1}:")
        assert name != "A" or block[number - 1][1] != "A", "a logic operation of two steps is not known here"
        kind, value, bit = "", 0, 0
        if operand.startswith("="):
            value = labels.index(operand[1:]) + 1
        elif operand.startswith("K"):
            kind, value = " K", constant(operand)
        elif name in ("SRW", "SLW"):
            value = int(operand)
        elif operand and name != "JU MUL:16":
            kind, value = f" {operand.split()[0]}", operand.split()[1]
            value, bit = (int(value.split(".")[0]), 1 << int(value.split(".")[1])) if "." in value else (int(value), 0)
        assert name + kind in LINES, f"{name} {operand} is not known here"
        lines.append("   " + LINES[name + kind].format(v=value, b=bit, o=operand))
    scope = {"signed": signed, "summed": (lambda one, other: signed(one + other)) if wraps else summed, "multiplied": multiplied}
    exec("\n".join(lines), scope)  # made of the lines above
    return scope["run"]
