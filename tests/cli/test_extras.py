"""What an extra brings is asked for in one line that names it, where it is missing; see also test_studio and test_served."""

import sys

import pytest

from heatertune.errors import InputError
from heatertune.log import read_log


@pytest.mark.parametrize(("module", "options", "told"), [
    ("pyarrow", ("-o", "zones.parquet"), "a Parquet table needs pyarrow: pip install 'heatertune[fleet]'"),
    ("distributed", ("-o", "zones.csv", "--scheduler", "tcp://127.0.0.1:9"),
     "--scheduler needs Dask: pip install 'heatertune[dask]'"),
])
def test_a_fleet_without_an_extra_names_it(module, options, told, run, tmp_path, monkeypatch):
    monkeypatch.setitem(sys.modules, module, None)
    monkeypatch.chdir(tmp_path)
    (tmp_path / "logs").mkdir()
    (tmp_path / "logs" / "zone.csv").write_text("time_s,temperature_degC,power_pct\n0,20,0\n10,20,50\n20,21,50\n")
    assert run("fleet", "logs", "--target", "weg", *options) == (2, "", f"error: {told}\n")


def test_a_table_without_pandas_names_its_extra(monkeypatch):
    monkeypatch.setitem(sys.modules, "pandas", None)
    with pytest.raises(InputError, match=r"a table needs pandas: pip install 'heatertune\[notebook\]'"):
        read_log("table4").to_frame()
