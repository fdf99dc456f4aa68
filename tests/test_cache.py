"""The cache gives back what was kept, or nothing at all."""

import hashlib
import json
import os

import pytest

from heatertune import cache
from heatertune.errors import DocumentError


def kept_one(place):
    """Keep one result; return its file."""
    assert result() == ({"number": 1.5, "nothing": None}, True)
    (path,) = place.iterdir()
    return path


def result():
    """Return the value, and whether it was computed."""
    runs = []

    def run():
        runs.append(1)
        return {"number": 1.5, "nothing": float("nan")}

    def read(document):
        if not isinstance(document.get("number"), float):
            raise DocumentError("number: expected a number")
        return document

    return cache.cached("stage", {"a": 1}, run, read), bool(runs)


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.setenv("HEATERTUNE_CACHE", str(tmp_path / "cache"))
    return tmp_path / "cache"


def signed(document):
    """A file as the cache writes it: schema, SHA-256 of the rest, the rest."""
    data = document.encode()
    return f"heatertune/cache/1 sha256:{hashlib.sha256(data).hexdigest()}\n".encode() + data


def test_what_is_kept_is_read_and_not_run(place):
    path = kept_one(place)
    head, _, text = path.read_bytes().partition(b"\n")
    assert head == f"heatertune/cache/1 sha256:{hashlib.sha256(text).hexdigest()}".encode()
    assert json.loads(text) == {"number": 1.5, "nothing": None}
    assert result() == ({"number": 1.5, "nothing": None}, False)


def damages(data):
    """Every way a file can be in doubt, one by one."""
    yield from (data[:length] for length in range(len(data)))
    for k in range(len(data)):
        yield data[:k] + bytes([data[k] ^ 1]) + data[k + 1:]
    yield data + b" "
    yield data.partition(b"\n")[2]
    yield b'{"number": 2.5}'
    yield signed('{"number": 2.5}').replace(b"cache/1", b"cache/2")
    for document in ("[]", "[1.5]", "1.5", '{"number": "x"}', '{"number": NaN}x', "{}", "[" * 100_000, "\ufeff{}"):
        yield signed(document)
    yield b"\xff" * 40


def test_a_file_in_any_doubt_is_made_anew(place):
    path = kept_one(place)
    whole = path.read_bytes()
    for data in damages(whole):
        path.write_bytes(data)
        assert result() == ({"number": 1.5, "nothing": None}, True), data[:100]
        assert path.read_bytes() == whole, "and kept again"


def test_what_is_no_file_is_no_result(place):
    path = kept_one(place)
    path.unlink()
    os.mkfifo(path)  # which would wait for ever
    assert result() == ({"number": 1.5, "nothing": None}, True)
    path.unlink()
    path.mkdir()
    told = []
    assert cache.cached("stage", {"a": 1}, lambda: {"number": 1.5}, dict, progress=told.append) == {"number": 1.5}
    assert told == [f"stage: the cache {place} cannot be written"]


def test_a_file_that_cannot_be_read_is_no_result(place, monkeypatch):
    kept_one(place)

    def refused(path):
        raise PermissionError(13, "Permission denied", path)

    monkeypatch.setattr(cache, "read_bytes", refused)
    assert result() == ({"number": 1.5, "nothing": None}, True)
