"""Folders whose log was exchanged or changed, with all digests computed again, and results planted in the cache: 0 exported, 0 written.

    python -m tests.bench.consistent_forgeries [logs | plants]

The forger knows the program and has every secret but this user's key. Logs: of two designs of one kind (a heater alone, a heater with a fan)
one has the other's log, in ways that keep the folder consistent. Plants: the proof of forged parameters is put in the place of the honest one
in the cache, signed in ways that a reader might believe. Judged by the files that come to be and by a Modbus device's registers.
"""

import base64
import contextlib
import gzip
import hashlib
import hmac
import json
import math
import os
import shutil
import sys
import tempfile
from pathlib import Path

from heatertune.live.write import plc_block
from tests.bench import sessions
from tests.bench.forgeries import PARTS, SCHEMA, leaks, quietly, report, sha256, with_words_of_the_design
from tests.conftest import fan_log, heater_log
from tests.live.conftest import hasty_clock
from tests.live.test_trust import documents


def designed(place, text, *more):
    """Return a folder as `design` writes it."""
    place.mkdir(parents=True)
    log = place / "log.csv"
    log.write_text(text, encoding="utf-8")
    status, said = quietly("design", log, "--target", "s5-ob251", "--setpoint", 50, "-o", place / "out", "--quiet", *more)
    assert status == 0, said
    return place / "out"


def other_fan_log():
    """Return a log of the same rows whose heater is stronger by a fifth."""
    head, *rows = fan_log().splitlines()
    cells = [row.split(";") for row in rows]
    return "\n".join([head, *(f"{t};{20 + 1.2 * (float(degC) - 20):.2f};{power};{fan}" for t, degC, power, fan in cells)]) + "\n"


class Folder:
    """A copy of a folder, its documents read, to be changed."""

    def __init__(self, made, place):
        self.path = place / "forged"
        shutil.copytree(made, self.path)
        self.data = self.path / "data"
        self.documents = {name: json.loads((self.data / f"{name}.json").read_text()) for name in PARTS}
        self.digest = json.loads((self.data / "digest.json").read_text())
        self.mark, self.covered, self.has_digest = None, PARTS, True

    def save(self):
        """Write the documents, and the digests computed again; return the digits that the proof begins with."""
        for name, document in self.documents.items():
            (self.data / f"{name}.json").write_text(json.dumps(document))
        rest = {"schema": "heatertune/digest/1", "documents": {name: sha256(self.documents[name]) for name in self.covered}}
        own = rest | {"digest": sha256(rest)}
        mark = self.mark(own["digest"]) if callable(self.mark) else self.mark
        (self.data / "digest.json").write_text(json.dumps(own if mark is None else own | {"mark": mark}))
        if not self.has_digest:
            (self.data / "digest.json").unlink()
        return self.documents["proof"]["digest"].partition(":")[2][:8]


def keyed(secret, how=hashlib.sha256):
    """Return what signs a digest with a secret that is not the user's."""
    return lambda digest: f"hmac-sha256:{hmac.new(secret, digest.encode(), how).hexdigest()}"


def with_log(here, other, **changed):
    """Exchange the log, keep the line that says how it was read, and change more of it."""
    line = here.documents["log"]["taken"]["line"]
    here.documents["log"] = json.loads(json.dumps(other["log"]))
    here.documents["log"]["taken"]["line"] = line
    here.documents["log"].update(changed)


def bare(here, other):
    """Exchange the log alone, whose line is its own."""
    here.documents["log"] = other["log"]


def set_mark(mark):
    """Return a forgery with the other's log and a mark."""
    def change(here, other):
        with_log(here, other)
        here.mark = mark(here, other) if callable(mark) else mark
    return change


def with_model(**changed):
    """Return a forgery with the other's log and changed fields of the model, in both documents that hold it."""
    def change(here, other):
        with_log(here, other)
        for model in (here.documents["model"], here.documents["pid"]["model"]):
            for name, value in changed.items():
                if value is None:
                    model.pop(name, None)
                else:
                    model[name] = value(model, other["model"]) if callable(value) else value
    return change


def residuals_far(model, _other):
    """Return residuals so large that any log lies within them."""
    own = model.get("residuals") or _other["residuals"]
    return own | {"simulated_degC": [each + 500.0 for each in own["measured_degC"]]}


def uncovered(here, other):
    """The digest covers what is exported alone, and has the mark of the honest one."""
    with_log(here, other)
    here.covered, here.mark = ("pid", "words", "proof"), here.digest.get("mark")


def without_digest(here, other):
    """Exchange the log in a folder of an earlier release."""
    with_log(here, other)
    here.has_digest = False


def scaled(here, _other):
    """The own log, half as much again above its beginning."""
    degC = here.documents["log"]["temperature_degC"]
    here.documents["log"]["temperature_degC"] = [degC[0] + 1.5 * (each - degC[0]) for each in degC]


def all_but_words(here, other):
    """Log and model are the other's."""
    here.documents["log"], here.documents["model"] = other["log"], other["model"]


def five_gains(here, _other):
    """Five times the gain in design, words and proof, with results that pass."""
    here.documents["pid"]["gain_pct_per_degC"] *= 5.0
    for name in ("words", "proof"):
        here.documents[name]["words"]["K"] *= 5
    for criterion in here.documents["proof"]["criteria"].values():
        criterion.update(ok=True)
    here.documents["proof"] = sealed(here.documents["proof"])


def weak_heater(here, _other):
    """A tenth of the heater's gain in both documents that hold it, so that its words seem calm."""
    for model in (here.documents["model"], here.documents["pid"]["model"]):
        model["gain_degC_per_pct"] *= 0.1
    for name in ("words", "proof"):
        here.documents[name]["words"]["K"] *= 8
    here.documents["proof"] = sealed(here.documents["proof"])


def sealed(proof):
    """Return a proof with its own digest computed again."""
    rest = {name: value for name, value in proof.items() if name != "digest"}
    return rest | {"digest": sha256(rest)}


FORGERIES = {
    "the log of the other": bare,
    "its line kept": set_mark(None),
    "a mark of zeros": set_mark("hmac-sha256:" + "0" * 64),
    "an empty mark": set_mark(""),
    "the mark of the honest folder": set_mark(lambda here, _: here.digest.get("mark")),
    "the mark of the other folder": set_mark(lambda _, other: other["digest"].get("mark")),
    "a mark by an empty key": set_mark(lambda *_: keyed(b"")),
    "a mark by a key of zeros": set_mark(lambda *_: keyed(bytes(32))),
    "a mark by a key of their own": set_mark(lambda *_: keyed(os.urandom(32))),
    "the digest as its own mark": set_mark(lambda *_: lambda digest: digest.replace("sha256", "hmac-sha256")),
    "a mark that is no ASCII": set_mark("hmac-sha256:é\ud800"),
    "a digest that leaves the log out": uncovered,
    "no digest": without_digest,
    "no line that says how it was read": lambda here, other: with_log(here, other, taken=None),
    "readings that are no numbers": lambda here, other: with_log(here, other, temperature_degC=[math.nan] * len(other["log"]["time_s"])),
    "no readings": lambda here, other: with_log(here, other, time_s=[], temperature_degC=[], power_pct=[]),
    "fewer readings than instants": lambda here, other: with_log(here, other, temperature_degC=other["log"]["temperature_degC"][:9]),
    "a cooler that never ran": lambda here, other: with_log(here, other, cooling_pct=[0.0] * len(other["log"]["time_s"])),
    "half as much again": scaled,
    "a model of several logs": with_model(log_summary=lambda own, other: [*own["log_summary"], *other["log_summary"]]),
    "a model without residuals": with_model(residuals=None),
    "residuals as large as a house": with_model(residuals=residuals_far),
    "log and model of the other": all_but_words,
    "five times the gain": five_gains,
    "a weak heater": weak_heater,
}


def of_logs(place, which=tuple(FORGERIES)):
    """Try the forged logs in both kinds of folders; return how many, and what is wrong."""
    kinds = {"heater": (designed(place / "h1", heater_log(0.9, 7)), designed(place / "h2", heater_log(0.75, 9))),
             "fan": (designed(place / "f1", fan_log(), "--disturbance-column", "fan"),
                     designed(place / "f2", other_fan_log(), "--disturbance-column", "fan"))}
    wrong, count = [], 0
    for kind, (one, two) in kinds.items():
        (here := place / f"{kind} whole").mkdir()
        whole = Folder(one, here)
        whole.mark = whole.digest.get("mark")
        assert leaks(one, whole.path, whole.save(), here), "the whole folder is exported, so that what was changed is what is refused"
        other = {name: json.loads((two / "data" / f"{name}.json").read_text()) for name in (*PARTS, "digest")}
        for name in which:
            (here := place / f"{kind}{count}").mkdir()
            folder = Folder(one, here)
            FORGERIES[name](folder, json.loads(json.dumps(other)))
            found = leaks(one, folder.path, folder.save(), here)
            print(f"{kind}, {name}: {found or 'refused'}", flush=True)
            wrong, count = wrong + found, count + 1
            shutil.rmtree(here)
    return count, wrong


def signed_as(name, text, secret, schema=SCHEMA, how="sha256"):
    """Return a first line as the cache's own, with what a forger may choose."""
    mark = hmac.new(secret, f"{schema}\n{name}\n".encode() + text, how).hexdigest()
    return f"{schema} hmac-{how}:{mark}\n".encode()


def plants(entry, text, honest, state):
    """Yield a name and what puts the forged proof in the place of an entry, in ways of this file's own."""
    head, _, _ = honest.partition(b"\n")
    mark = head.partition(b":")[2]
    key = state / "cache.key"

    def put(content):
        return lambda: entry.write_bytes(content)

    yield "the honest mark in capitals", put(head.replace(mark, mark.upper()) + b"\n" + text)
    yield "half of the honest mark", put(head[:-32] + b"\n" + text)
    yield "no mark", put(head.partition(b" ")[0] + b"\n" + text)
    yield "a mark of another kind", put(signed_as(entry.name, text, b"", how="md5") + text)
    yield "SHA-1 by no key", put(signed_as(entry.name, text, b"", how="sha1") + text)
    yield "the schema of the next release", put(signed_as(entry.name, text, b"", "heatertune/cache/3") + text)
    yield "signed with its own name", put(signed_as(entry.name, text, entry.name.encode()) + text)
    yield "signed with the mark of the honest one", put(signed_as(entry.name, text, mark) + text)
    yield "signed with the user's name", put(signed_as(entry.name, text, os.environ.get("USER", "root").encode()) + text)
    yield "a byte order mark before all", put(b"\xef\xbb\xbf" + head + b"\n" + text)
    yield "an empty line before all", put(b"\n" + head + b"\n" + text)
    yield "two lines in one", put(head + b"\r" + text + b"\n" + honest.partition(b"\n")[2])
    yield "the honest text with other keys behind it", put(honest.rstrip()[:-1] + b", " + text.lstrip()[1:])
    yield "packed", put(gzip.compress(head + b"\n" + text))
    yield "as base64", put(head + b"\n" + base64.b64encode(text))
    yield "a pipe", lambda: os.mkfifo(entry)

    def short_key():
        key.write_bytes(b"x")
        entry.write_bytes(signed_as(entry.name, text, b"x") + text)

    def linked_key():
        (state / "other.key").write_bytes(bytes(range(32)))
        (state / "other.key").chmod(0o644)
        key.unlink()
        key.symlink_to(state / "other.key")
        entry.write_bytes(signed_as(entry.name, text, bytes(range(32))) + text)

    yield "a key of one byte", short_key
    yield "a key that is a link to one that all may read", linked_key


def of_plants(made, place, state):
    """Try the plants; return how many, and what is wrong."""
    cache, wrong, count = Path(os.environ["HEATERTUNE_CACHE"]), [], 0
    (begin := place / "begin").mkdir()
    folder, yes = with_words_of_the_design(made, begin)
    entry = max(cache.glob("proof-*.json"), key=lambda each: each.stat().st_mtime_ns)
    honest, secret = entry.read_bytes(), (state / "cache.key").read_bytes()
    text = (json.dumps(documents(folder)["proof"], indent=2) + "\n").encode()
    for number, (name, put) in enumerate(plants(entry, text, honest, state)):
        entry.unlink(missing_ok=True)
        put()
        (here := place / f"plant{number}").mkdir()
        found = leaks(made, folder, yes, here)
        print(f"plant {name}: {found or 'refused'}", flush=True)
        wrong, count = wrong + found, count + 1
        with contextlib.suppress(FileNotFoundError):
            entry.unlink()
        (state / "cache.key").unlink(missing_ok=True)
        (state / "cache.key").write_bytes(secret)
        (state / "cache.key").chmod(0o600)
    entry.write_bytes(signed_as(entry.name, text, secret) + text)
    (here := place / "own").mkdir()
    assert leaks(made, folder, yes, here), "the user's own key opens it, so that what was planted is what is read"
    return count, wrong


def main(kind=""):
    """Try them; return 1 where one is exported or written."""
    plc_block.HOST = hasty_clock()
    with tempfile.TemporaryDirectory() as temporary:
        place, bad = Path(temporary), []
        state = place / "state"
        os.environ |= {"HEATERTUNE_STATE": str(state), "HEATERTUNE_CACHE": str(place / "cache")}
        for name in ("logs", "plants"):
            if kind not in ("", name):
                continue
            (place / name).mkdir()
            if name == "logs":
                count, wrong = of_logs(place / name)
            else:
                made = sessions.folder_in(place / "made")
                count, wrong = of_plants(made, place / name, state)
            report(name, count, wrong)
            bad += wrong
    return int(bool(bad))


if __name__ == "__main__":
    sys.exit(main(*sys.argv[1:]))
