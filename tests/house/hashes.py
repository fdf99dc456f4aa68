"""Print the lock with the digests of its files: `python -m tests.house.hashes report.json > constraints/hashes.txt`.

The report is that of pip: `pip install --dry-run --ignore-installed --report report.json -c constraints/lock.txt '.[test]'`.
"""

import json
import sys
from pathlib import Path

HEAD = """\
# The lock with the digest of each file that pip takes on Linux (x86-64) for Python 3.11: pip install --require-hashes --no-deps -r
# this file, then heatertune itself with --no-deps. Anew: see CONTRIBUTING.md.
"""


def locked(report):
    """Return a line for each package of pip's report, but for heatertune itself."""
    for each in report["install"]:
        name = each["metadata"]["name"].lower().replace("_", "-")
        if name != "heatertune":
            digest = each["download_info"]["archive_info"]["hashes"]["sha256"]
            yield f"{name}=={each['metadata']['version']} --hash=sha256:{digest}"


if __name__ == "__main__":
    print(HEAD + "\n".join(sorted(locked(json.loads(Path(sys.argv[1]).read_text(encoding="utf-8"))))))
