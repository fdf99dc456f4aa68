"""The cache gives back what was kept, or nothing at all."""

import hashlib
import hmac
import json
import os
import stat
from pathlib import Path

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

    return cache.load_or_compute("stage", {"a": 1}, run, read), bool(runs)


@pytest.fixture
def place(tmp_path, monkeypatch):
    monkeypatch.setenv("HEATERTUNE_CACHE", str(tmp_path / "cache"))
    monkeypatch.setenv("HEATERTUNE_STATE", str(tmp_path / "state"))
    return tmp_path / "cache"


def signed(document, name, schema="heatertune/cache/2"):
    """A file as the cache writes it: schema, HMAC-SHA-256 of schema, name and the rest with the secret, the rest."""
    data = document.encode()
    secret = (Path(os.environ["HEATERTUNE_STATE"]) / "cache.key").read_bytes()
    digest = hmac.new(secret, f"{schema}\n{name}\n".encode() + data, "sha256").hexdigest()
    return f"{schema} hmac-sha256:{digest}\n".encode() + data


def plainly_signed(document):
    """A file as anyone can write it: the digest needs no secret."""
    data = document.encode()
    return f"heatertune/cache/1 sha256:{hashlib.sha256(data).hexdigest()}\n".encode() + data


@pytest.fixture
def replaced(monkeypatch):
    """As if the source had been replaced after this process had imported it."""
    monkeypatch.setattr(cache, "_IMPORTED_S", 0.0)
    cache.source_digest.cache_clear()
    yield
    cache.source_digest.cache_clear()


def test_a_program_whose_source_was_replaced_keeps_and_reads_nothing(place, replaced):
    notes = []
    for _ in range(2):
        cache.load_or_compute("stage", {}, lambda: {"number": 1.5}, lambda document: document, progress=notes.append)
    assert not place.exists()
    assert notes == 2 * ["stage: heatertune's own source was replaced while it runs: nothing is kept"]
    assert cache.source_digest() is None


def test_a_clock_that_was_set_back_is_no_replaced_source(monkeypatch):
    """A computer without a battery starts in the past: its files are from the future until the network tells the time."""
    monkeypatch.setattr(cache, "_IMPORTED_S", 10.0)
    monkeypatch.setattr(cache.time, "time", lambda: 20.0)
    assert cache.is_as_imported([Path(cache.__file__)])
    assert not cache.is_as_imported([Path(cache.__file__).with_name("gone.py")])


def test_what_is_kept_is_read_and_not_run(place):
    path = kept_one(place)
    _, _, text = path.read_bytes().partition(b"\n")
    assert path.read_bytes() == signed(text.decode(), path.name)
    assert json.loads(text) == {"number": 1.5, "nothing": None}
    assert result() == ({"number": 1.5, "nothing": None}, False)


def damages(data, name):
    """Every way a file can be in doubt, one by one."""
    yield from (data[:length] for length in range(len(data)))
    for k in range(len(data)):
        yield data[:k] + bytes([data[k] ^ 1]) + data[k + 1:]
    yield data + b" "
    yield data.partition(b"\n")[2]
    yield b'{"number": 2.5}'
    yield signed('{"number": 2.5}', name).replace(b"cache/2", b"cache/3")
    yield signed('{"number": 2.5}', name, "heatertune/cache/1")
    yield signed('{"number": 2.5}', "stage-" + 32 * "0" + ".json")  # the result of other inputs
    yield plainly_signed('{"number": 2.5}')
    for document in ("[]", "[1.5]", "1.5", '{"number": "x"}', '{"number": NaN}x', "{}", "[" * 100_000, "\ufeff{}"):
        yield signed(document, name)
    yield b"\xff" * 40


@pytest.mark.long
def test_a_file_in_any_doubt_is_made_anew(place):
    path = kept_one(place)
    whole = path.read_bytes()
    for data in damages(whole, path.name):
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
    assert cache.load_or_compute("stage", {"a": 1}, lambda: {"number": 1.5}, dict, progress=told.append) == {"number": 1.5}
    assert told == [f"stage: the cache {place} cannot be written"]


def test_a_file_that_cannot_be_read_is_no_result(place, monkeypatch):
    kept_one(place)

    def refused(path):
        raise PermissionError(13, "Permission denied", path)

    monkeypatch.setattr(cache, "read_bytes", refused)
    assert result() == ({"number": 1.5, "nothing": None}, True)


def test_the_secret_is_made_once_and_for_its_user_alone(place):
    kept_one(place)
    key = Path(os.environ["HEATERTUNE_STATE"]) / "cache.key"
    first = key.read_bytes()
    assert (len(first), stat.S_IMODE(key.stat().st_mode)) == (32, 0o600)
    assert result()[1] is False
    assert key.read_bytes() == first
    assert [path.name for path in key.parent.iterdir()] == ["cache.key"]
    key.unlink()  # another machine, or another user: nothing that was kept is believed
    assert result() == ({"number": 1.5, "nothing": None}, True)
    assert result()[1] is False
    assert key.read_bytes() != first


@pytest.mark.parametrize("mode", [0o640, 0o604, 0o666])
def test_a_secret_that_others_may_read_is_no_secret(place, mode):
    kept_one(place)
    (Path(os.environ["HEATERTUNE_STATE"]) / "cache.key").chmod(mode)
    assert result() == ({"number": 1.5, "nothing": None}, True)
    assert result() == ({"number": 1.5, "nothing": None}, True)


@pytest.mark.parametrize("mode", [0o777, 0o775, 0o757, 0o1777])
def test_a_folder_that_others_may_write_is_neither_read_nor_written(place, mode):
    kept_one(place)
    place.chmod(mode)
    before, lines = sorted(place.iterdir()), []
    assert cache.load_or_compute("stage", {"a": 1}, lambda: {"number": 7.5}, dict, progress=lines.append) == {"number": 7.5}
    assert cache.load_or_compute("stage", {"a": 2}, lambda: {"number": 8.5}, dict) == {"number": 8.5}
    assert lines == [f"stage: the cache {place} is not used: other users may write there; chmod go-w {place} makes it "
                     "private: nothing is kept"]
    assert sorted(place.iterdir()) == before
    assert cache.folder() is None, "machine code is not read from there either"
    place.chmod(mode & ~0o022)
    assert result()[1] is False


@pytest.mark.skipif(not hasattr(os, "geteuid") or os.geteuid() != 0, reason="only root can give a folder away")
def test_a_folder_of_another_user_is_not_used(place):
    kept_one(place)
    os.chown(place, 65534, 65534)
    assert cache.folder() is None
    assert cache.not_private() == f"the cache {place} is not used: it belongs to another user"
    assert result() == ({"number": 1.5, "nothing": None}, True)


def test_a_folder_that_the_cache_makes_is_its_users_alone(place):
    mask = os.umask(0o002)
    try:
        kept_one(place)
    finally:
        os.umask(mask)
    assert stat.S_IMODE(place.stat().st_mode) & 0o022 == 0
    assert result()[1] is False
