"""Against a real Dask cluster: a scheduler and two worker processes."""

import subprocess
import sys

import pyarrow.parquet
import pytest
from tests.chain.batch_work import batch_of, expected_row
from tests.conftest import ROOT

from heatertune.batch import in_processes, on_dask, run
from heatertune.errors import InputError


@pytest.fixture
def cluster(request, monkeypatch):
    monkeypatch.setenv("DASK_DISTRIBUTED__SCHEDULER__ALLOWED_FAILURES", str(getattr(request, "param", 3)))
    command = [sys.executable, "-m", "tests.chain.cluster"]
    process = subprocess.Popen(command, cwd=ROOT, stdin=subprocess.PIPE, stdout=subprocess.PIPE,
                               stderr=subprocess.DEVNULL, text=True)
    process.address = process.stdout.readline().strip()
    yield process
    process.communicate("end\n", timeout=120.0)


@pytest.mark.long
def test_a_cluster_that_loses_a_worker_half_way_writes_what_one_process_writes(cluster, tmp_path):
    number, diary = 60, tmp_path / "diary"
    one, many = tmp_path / "one.parquet", tmp_path / "many.parquet"
    run(batch_of(number), one, workers=in_processes(1))
    killed = []

    def half_way(done, total):
        if done >= total // 2 and not killed:
            cluster.stdin.write("kill\n")
            cluster.stdin.flush()
            killed.append(int(cluster.stdout.readline()))

    summary = run(batch_of(number, seconds=0.02, diary=str(diary)), many, workers=on_dask(cluster.address),
                  progress=half_way)
    assert len(killed) == 1
    assert summary["rows"] == number
    assert many.read_bytes() == one.read_bytes()
    assert set(map(int, diary.read_text().split())) == set(range(number))


@pytest.mark.long
@pytest.mark.parametrize("cluster", [0], indirect=True)  # as seldom as can be: every death costs a new worker
def test_a_case_that_kills_every_worker_takes_no_other_along(cluster, tmp_path):
    out = tmp_path / "table.parquet"
    # long enough that another case waits behind the deadly one, and the scheduler blames both
    summary = run(batch_of(12, always_deadly=[5], seconds=0.05), out, workers=on_dask(cluster.address))
    assert summary["outcomes"] == {"FAIL": 5, "PASS": 6, "crashed": 1}
    rows = pyarrow.parquet.read_table(out).to_pylist()
    assert [row for k, row in enumerate(rows) if k != 5] == [expected_row(k) for k in range(12) if k != 5]


def test_without_dask_the_extra_is_named(monkeypatch):
    monkeypatch.setitem(sys.modules, "distributed", None)
    with pytest.raises(InputError, match=r"pip install 'heatertune\[dask\]'"):
        on_dask("tcp://127.0.0.1:1")


def test_an_address_without_a_scheduler_is_told_in_one_line(tmp_path, monkeypatch):
    monkeypatch.setattr("heatertune.batch.engine._PATIENCE_S", 0.2)
    with pytest.raises(InputError, match=r"--scheduler tcp://127.0.0.1:1: no Dask scheduler answers at this address"):
        run(batch_of(3), tmp_path / "t.parquet", workers=on_dask("tcp://127.0.0.1:1"))
    with pytest.raises(InputError, match="--scheduler nonsense://x: no Dask scheduler answers at this address"):
        run(batch_of(3), tmp_path / "t.parquet", workers=on_dask("nonsense://x"), resume=True)
