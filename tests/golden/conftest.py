"""awlsim, a second implementation of the S7-300 in the `test` extra."""

import json
import subprocess
import sys
from pathlib import Path

import pytest

DRIVER = Path(__file__).with_name("awlsim_driver.py")


@pytest.fixture(scope="session")
def awlsim(tmp_path_factory):
    """Run STL source text scan by scan; see the driver for rows and answer."""

    def run(text, rows, block=100, scan_s=None, asked=12, restart=0):
        source = tmp_path_factory.mktemp("awl") / "export.awl"
        source.write_text(text, encoding="ascii", newline="")
        task = json.dumps({"source": str(source), "block": block, "rows": rows, "scan_s": scan_s, "asked": asked,
                           "restart": restart})
        done = subprocess.run([sys.executable, DRIVER], input=task, capture_output=True, text=True, check=False)
        assert done.returncode == 0, done.stderr[-2000:]
        return json.loads(done.stdout)

    return run
