"""`doctor` finds what is broken, and only what is broken."""

import json
import re
from importlib import metadata

import casadi
import pytest

from heatertune import cache, doctor
from heatertune.compiled import dispatch
from heatertune.errors import LogError
from heatertune.log import log_values as tables


def _by_name(findings):
    return {each.name: each for each in findings}


@pytest.mark.long
def test_a_working_installation_is_well(run):
    status, out, _ = run("doctor", "--json")
    document = json.loads(out)
    assert (status, document["schema"], document["well"]) == (0, "heatertune/doctor/2", True)
    found = {each["name"]: each for each in document["findings"]}
    assert found["numpy"]["value"] == metadata.version("numpy")
    assert found["paper tables"]["value"] == "table3: 240 readings, table4: 240 readings"
    assert "2.0000" in found["IPOPT"]["value"]
    status, out, _ = run("doctor")
    assert (status, out.splitlines()[-1]) == (0, "all that is needed works")


def test_every_package_of_the_projects_metadata_is_looked_at():
    needed = {re.split("[<>]", line)[0] for line in metadata.requires("heatertune") if "extra" not in line}
    assert needed <= set(_by_name(doctor._packages()))
    assert len(needed) >= 6


def test_a_missing_package_is_a_fail_with_its_remedy(run, monkeypatch):
    real = metadata.version

    def version(name):
        if name == "control":
            raise metadata.PackageNotFoundError(name)
        return real(name)

    monkeypatch.setattr(doctor.metadata, "version", version)
    status, out, err = run("doctor")
    assert status == 1
    assert "pip install --upgrade 'control>=0.10.1'" in out
    assert out.splitlines()[-1] == "FAIL: see above"
    assert err == ""


@pytest.mark.parametrize(("version", "ok"), [("1.25.9", False), ("1.26", True), ("1.26.0rc1", True), ("2.0", True),
                                             ("1.3", False), ("10.0+local.1", True)])
def test_an_old_package_is_told_from_a_new_one(monkeypatch, version, ok):
    monkeypatch.setattr(doctor.metadata, "version", lambda _: version)
    assert doctor._package("numpy", ">=1.26").ok is ok


@pytest.mark.parametrize(("version", "ok"), [("0.59.9", False), ("0.60.0", True), ("0.68.1", True), ("0.69.0rc1", False), ("0.69.0", False)])
def test_a_package_newer_than_what_was_tried_is_told_with_the_releases_to_install(monkeypatch, version, ok):
    monkeypatch.setattr(doctor.metadata, "version", lambda _: version)
    found = doctor._package("numba", "<0.69,>=0.60")
    assert (found.ok, found.remedy) == (ok, "pip install --upgrade 'numba<0.69,>=0.60'")


@pytest.mark.parametrize(("holds", "value"), [(True, "called directly"), (False, "on Numba's own path: right, but each run compiles")])
def test_how_machine_code_is_called_is_told_and_is_no_fail(monkeypatch, holds, value):
    monkeypatch.setattr(dispatch, "tricks_hold", lambda: holds)
    found = doctor._machine_code()
    assert (found.value, found.ok, found.required) == (value, holds, False)


def test_a_package_that_cannot_be_imported_is_broken(monkeypatch):
    def broken(name):
        raise RuntimeError("compiled for\nanother numpy")

    monkeypatch.setattr(doctor, "import_module", broken)
    found = doctor._package("scipy", ">=1.11")
    assert not found.ok
    assert "RuntimeError: compiled for another numpy" in found.value


def test_a_casadi_without_ipopt_is_broken_and_so_is_one_that_errs(monkeypatch):
    def without(*_):
        raise RuntimeError("Plugin 'ipopt' is not found.")

    monkeypatch.setattr(casadi, "nlpsol", without)
    assert not doctor._ipopt().ok
    assert "not found" in doctor._ipopt().value
    # one that solves, but wrongly: x = 3 breaks the bound x <= 2
    monkeypatch.setattr(casadi, "nlpsol", lambda *_: lambda **_: {"x": 3.0})
    assert not doctor._ipopt().ok
    assert doctor._ipopt().required


def test_missing_tables_are_a_fail(monkeypatch):
    def missing():
        raise LogError("the built-in tables are missing", file="table3.csv")

    monkeypatch.setattr(tables, "_folder", missing)
    found = doctor._tables()
    assert (found.ok, found.required) == (False, True)


def test_a_cache_that_cannot_be_written_is_told_but_no_fail(monkeypatch, tmp_path):
    (tmp_path / "file").write_text("")
    monkeypatch.setenv("HEATERTUNE_CACHE", str(tmp_path / "file" / "cache"))
    found = doctor._results()
    assert (found.ok, found.required) == (False, False)
    assert doctor.document([found])["well"]
    monkeypatch.setenv("HEATERTUNE_CACHE", "")
    assert doctor._results().value == "switched off"
    assert cache.folder() is None


def test_where_no_result_is_kept_machine_code_still_is(monkeypatch, tmp_path):
    # a worker of a fleet keeps no zone's results, but must not compile the loop anew
    monkeypatch.setenv("HEATERTUNE_CACHE", str(tmp_path))
    with cache.cache_disabled():
        assert cache.load_or_compute("stage", {"a": 1}, lambda: {"b": 2}, dict) == {"b": 2}
        assert cache.folder() == tmp_path
    assert not list(tmp_path.iterdir())
    cache.load_or_compute("stage", {"a": 1}, lambda: {"b": 2}, dict)
    with cache.cache_disabled():
        assert cache.load_or_compute("stage", {"a": 1}, lambda: {"b": 3}, dict) == {"b": 3}, "nothing is read either"


def test_the_cache_counts_what_it_keeps(monkeypatch, tmp_path):
    place = tmp_path / "not" / "yet"
    monkeypatch.setenv("HEATERTUNE_CACHE", str(place))
    assert doctor._results().ok, "it can be made"
    cache.load_or_compute("stage", {"a": 1}, lambda: {"b": 2}, dict)
    assert "1 results, 0.0 MB" in doctor._results().value


def test_compiled_code_is_warm_once_something_of_it_is_kept(monkeypatch, tmp_path):
    monkeypatch.setenv("HEATERTUNE_CACHE", str(tmp_path))
    assert "cold" in doctor._compiled().value
    for name in ("compiled-1/_simulate-0123456789abcdef.code", "compiled-2/price-0123456789abcdef.code"):
        (tmp_path / name).parent.mkdir(parents=True)
        (tmp_path / name).write_bytes(bytes(150_000))
    told = doctor._compiled()
    assert told.ok
    assert told.value == f"{tmp_path}; warm, 2 functions, 0.3 MB"
    monkeypatch.setenv("HEATERTUNE_CACHE", "")
    assert doctor._compiled().value == "switched off: every process compiles"


def test_a_missing_extra_is_told_but_no_fail(monkeypatch):
    monkeypatch.setattr(doctor, "_installed", lambda name: name != "jupyterlab")
    found = _by_name(doctor._extras())
    assert found["extra notebook"].value == "missing: jupyterlab"
    assert found["extra notebook"].remedy == "pip install 'heatertune[notebook]'"
    assert not found["extra notebook"].required
    assert found["extra test"].ok
