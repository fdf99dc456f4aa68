"""Forged folders, and results planted in the cache of a forged folder: none is exported, none written.

    python -m tests.bench.forgeries [folders | plants | swaps]

A forger knows the program and computes every digest that needs no secret. 26 forged folders are those of `tests.live.test_trust`. For the
plants, design, words and results of a folder are changed together (five times the gain, with results that pass), and what the honest proof
of these words left in the cache is replaced by the forged proof, in 18 ways. Swaps: every mixture of log, model, design, words and proof of
two designs, with the digest of one of them, of the other, computed again, or without one. Judged by the files that come to be and by the registers of
`tests.live.modbus_device`.
"""

import contextlib
import hashlib
import hmac
import io
import itertools
import json
import os
import re
import shutil
import sys
import tempfile
from pathlib import Path

from heatertune.cli import main as command
from heatertune.live.write import plc_block
from tests.bench import sessions
from tests.conftest import heater_log
from tests.live.conftest import hasty_clock
from tests.live.test_trust import FORGERIES, device, documents, forged

SCHEMA = "heatertune/cache/2"


def quietly(*line):
    """Run a command; return its exit status and what it says."""
    said = io.StringIO()
    with contextlib.redirect_stdout(said), contextlib.redirect_stderr(said):
        status = command([str(each) for each in line])
    return status, " ".join(said.getvalue().split())


def leaks(made, folder, yes, place):
    """Export and write a folder; return what came of it that must not."""
    wrong, out = [], place / "exported"
    status, said = quietly("export-db", folder / "data" / "words.json", "--target", "s5-ob251", "-o", out, "--quiet")
    if status == 0 or out.exists():
        wrong.append(f"exported: {said}")
    called = documents(folder)["words"]["sample_time_s"]
    with device(made, K=5000, TI=60) as plc:
        before = bytes(plc.memory)
        status, said = quietly("write", folder, f"modbus://127.0.0.1:{plc.port}/1/0", "--range", 0, 100, "--called-every", called, "--apply",
                               "--confirm", yes, "--record", place / "r.jsonl", "--quiet", "--no-watch")
        if status == 0 or plc.writes or bytes(plc.memory) != before:
            wrong.append(f"written: {said}")
    return wrong


def signed(name, text, secret):
    """Return a first line as the cache's own, by another secret."""
    mark = hmac.new(secret, f"{SCHEMA}\n{name}\n".encode() + text, hashlib.sha256).hexdigest()
    return f"{SCHEMA} hmac-sha256:{mark}\n".encode()


def plants(entry, forged_text, other, state):
    """Yield a name and what puts a forged result in the place of an entry.

    Args:
        entry: file of the cache, as the honest proof left it.
        forged_text: the forged proof.
        other: content of an entry that is signed rightly, of other words.
        state: folder of the user's state.
    """
    honest = entry.read_bytes()
    head = honest.partition(b"\n")[0] + b"\n"
    plain = f"heatertune/cache/1 sha256:{hashlib.sha256(forged_text).hexdigest()}\n".encode()
    elsewhere = entry.with_name("elsewhere.json")

    def link(content, to=elsewhere):
        elsewhere.write_bytes(content)
        entry.symlink_to(to)

    yield "digest of the release before", lambda: entry.write_bytes(plain + forged_text)
    yield "the honest first line", lambda: entry.write_bytes(head + forged_text)
    yield "no first line", lambda: entry.write_bytes(forged_text)
    yield "an empty secret", lambda: entry.write_bytes(signed(entry.name, forged_text, b"") + forged_text)
    yield "a secret of zeros", lambda: entry.write_bytes(signed(entry.name, forged_text, bytes(32)) + forged_text)
    yield "a secret of another machine", lambda: entry.write_bytes(signed(entry.name, forged_text, os.urandom(32)) + forged_text)
    yield "an entry of other words, signed rightly", lambda: entry.write_bytes(other)
    yield "its first line with the forged text", lambda: entry.write_bytes(other.partition(b"\n")[0] + b"\n" + forged_text)
    yield "two first lines", lambda: entry.write_bytes(head + plain + forged_text)
    yield "the honest entry, and the forged text behind it", lambda: entry.write_bytes(honest + forged_text)
    yield "the forged text, and the honest entry behind it", lambda: entry.write_bytes(forged_text + honest)
    yield "half of it", lambda: entry.write_bytes((head + forged_text)[: len(forged_text) // 2])
    yield "nothing", lambda: entry.write_bytes(b"")
    yield "a link to a forged file", lambda: link(plain + forged_text)
    yield "a link to itself", lambda: entry.symlink_to(entry)
    yield "a folder", entry.mkdir
    yield "a text that is nested 100,000 times", lambda: entry.write_bytes(head + b"[" * 100_000)

    def own_secret():
        (state / "cache.key").write_bytes(bytes(32))
        (state / "cache.key").chmod(0o666)
        entry.write_bytes(signed(entry.name, forged_text, bytes(32)) + forged_text)

    yield "a secret that others may write", own_secret


def with_words_of_the_design(made, place):
    """Return a folder with five times the gain, whose words are those that the design makes, and results that pass."""
    words = {}

    def change(found):
        FORGERIES["design and words"](found)
        for name in ("words", "proof"):
            found[name]["words"].update(words)

    while True:
        shutil.rmtree(place / "forged", ignore_errors=True)
        folder, yes = forged(made, place, change)
        _, said = quietly("export-db", folder / "data" / "words.json", "--target", "s5-ob251", "-o", place / "no", "--quiet")
        found = re.search(r"words\.(\w+): \S+ the design makes it (-?\d+)", said)
        if found is None:
            return folder, yes
        words[found[1]] = int(found[2])


def of_folders(made, place):
    """Try the forged folders; return how many, and what is wrong."""
    wrong = []
    for number, (name, change) in enumerate(FORGERIES.items()):
        (here := place / str(number)).mkdir()
        folder, yes = forged(made, here, change)
        found = leaks(made, folder, yes, here)
        print(f"folder {name}: {found or 'refused'}", flush=True)
        wrong += found
    return len(FORGERIES), wrong


def of_plants(made, place, state, which=range(18)):
    """Try the plants of these numbers; return how many, and what is wrong."""
    cache, wrong, count = Path(os.environ["HEATERTUNE_CACHE"]), [], 0
    (begin := place / "begin").mkdir()
    folder, yes = with_words_of_the_design(made, begin)
    entries = sorted(cache.glob("proof-*.json"), key=lambda each: each.stat().st_mtime_ns)
    other, entry = entries[0].read_bytes(), entries[-1]
    assert len(entries) == 2
    assert leaks(made, folder, yes, begin) == []
    honest, secret = entry.read_bytes(), (state / "cache.key").read_bytes()
    text = (json.dumps(documents(folder)["proof"], indent=2) + "\n").encode()
    for number, (name, put) in enumerate(plants(entry, text, other, state)):
        if number not in which:
            continue
        shutil.rmtree(entry) if entry.is_dir() and not entry.is_symlink() else entry.unlink(missing_ok=True)
        put()
        (here := place / f"plant{number}").mkdir()
        found = leaks(made, folder, yes, here)
        print(f"plant {name}: {found or 'refused'}", flush=True)
        wrong, count = wrong + found, count + 1
        shutil.rmtree(entry) if entry.is_dir() and not entry.is_symlink() else entry.unlink(missing_ok=True)
        (state / "cache.key").unlink()
        (state / "cache.key").write_bytes(secret)
        (state / "cache.key").chmod(0o600)
        entry.write_bytes(honest)
    entry.write_bytes(signed(entry.name, text, secret) + text)
    (here := place / "own").mkdir()
    assert leaks(made, folder, yes, here), "the machine's own secret opens it, so that what was planted is what is read"
    return count, wrong


PARTS = ("log", "model", "pid", "words", "proof")
DIGESTS = ("kept", "other", "computed again", "none")


def whole_folder(place, gain):
    """Return a folder as `design` writes it, of a log of its own."""
    place.mkdir()
    log = place / "log.csv"
    log.write_text(heater_log(gain, 7), encoding="utf-8")
    status, said = quietly("design", log, "--target", "s5-ob251", "--setpoint", 50, "-o", place / "out", "--quiet")
    assert status == 0, said
    return place / "out"


def mixtures():
    """Yield the names of the documents that are taken from the other design."""
    for count in range(1, len(PARTS)):
        yield from itertools.combinations(PARTS, count)


def mixed(one, other, names, digest, place):
    """Return a copy of a folder with documents of another design, and the digits that its proof begins with."""
    folder = place / "mixed"
    shutil.copytree(one, folder)
    for name in names:
        shutil.copy(other / "data" / f"{name}.json", folder / "data")
    file = folder / "data" / "digest.json"
    if digest == "other":
        shutil.copy(other / "data" / "digest.json", file)
    elif digest == "computed again":  # as `digest_of` says, in words of our own
        found = {name: sha256(json.loads((folder / "data" / f"{name}.json").read_text())) for name in PARTS}
        document = {"schema": "heatertune/digest/1", "documents": found}
        file.write_text(json.dumps(document | {"digest": sha256(document)}))
    elif digest == "none":
        file.unlink()
    return folder, json.loads((folder / "data" / "proof.json").read_text())["digest"].partition(":")[2][:8]


def sha256(document):
    """Return the digest of a document: of its JSON without spaces, its keys in order."""
    return f"sha256:{hashlib.sha256(json.dumps(document, sort_keys=True, separators=(',', ':')).encode()).hexdigest()}"


def of_swaps(made, place):
    """Try the mixtures; return how many, and what is wrong."""
    one, other = (whole_folder(place / name, gain) for name, gain in (("one", 0.9), ("other", 0.75)))
    own = json.loads((one / "data" / "digest.json").read_text())
    assert own["documents"] == {name: sha256(json.loads((one / "data" / f"{name}.json").read_text())) for name in PARTS}
    (here := place / "whole").mkdir()
    shutil.copytree(one, here / "copy")
    yes = json.loads((one / "data" / "proof.json").read_text())["digest"].partition(":")[2][:8]
    assert leaks(made, here / "copy", yes, here), "the whole folder is exported, so that what was mixed is what is refused"
    wrong, count = [], 0
    for names in mixtures():
        for digest in DIGESTS:
            (here := place / f"swap{count}").mkdir()
            folder, yes = mixed(one, other, names, digest, here)
            found = leaks(made, folder, yes, here)
            if found:
                print(f"swap {', '.join(names)}, digest {digest}: {found}", flush=True)
            wrong, count = wrong + found, count + 1
            shutil.rmtree(here)
    return count, wrong


def report(name, count, wrong):
    """Print how many of so many forgeries were exported and written."""
    print(f"{count} forged {name}: {sum(each[:8] == 'exported' for each in wrong)} exported, "
          f"{sum(each[:7] == 'written' for each in wrong)} written", flush=True)


def main(kind=""):
    """Try them; return 1 where one is exported or written."""
    plc_block.HOST = hasty_clock()
    with tempfile.TemporaryDirectory() as temporary:
        place = Path(temporary)
        state = place / "state"
        os.environ |= {"HEATERTUNE_STATE": str(state), "HEATERTUNE_CACHE": str(place / "cache")}
        made = sessions.folder_in(place / "made")
        quietly("export-db", made / "data" / "words.json", "--target", "s5-ob251", "-o", place / "again", "--quiet")
        bad = []
        for name, run in (("folders", lambda: of_folders(made, place)), ("plants", lambda: of_plants(made, place, state)),
                          ("swaps", lambda: of_swaps(made, place / "swaps"))):
            if kind in ("", name):
                (place / "swaps").mkdir(exist_ok=True)
                count, wrong = run()
                report(name, count, wrong)
                bad += wrong
    return int(bool(bad))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
