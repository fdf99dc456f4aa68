"""Compare the outputs with the digests in `digests.txt`.

    python -m tests.frozen                   name every output that changed, is new or is gone; exit status 1 where one is
    python -m tests.frozen --keep FOLDER     the same, and write all outputs as files: `diff -r` of two checkouts' folders
    python -m tests.frozen --update          write the digests again
    python -m tests.frozen s7-300 klipper    only the designs for these controllers

A working folder below the temporary one is used and removed. What heatertune's cache holds is used, too: its keys hold
the source, so a change of the source is a change of the key.
"""

import argparse
import sys

from tests.frozen.digests import changes, collect, read_digests, write_digests

from heatertune.plc import NAMES


def run(arguments: list[str] | None = None) -> int:
    """Run the command."""
    parser = argparse.ArgumentParser(prog="python -m tests.frozen", description="Compare the outputs with their digests.")
    parser.add_argument("targets", nargs="*", metavar="CONTROLLER", help="only the designs for these (default: everything)")
    parser.add_argument("--keep", metavar="FOLDER", help="write all outputs into this folder, to be compared by diff -r")
    parser.add_argument("--update", action="store_true", help="write the digests again")
    options = parser.parse_args(arguments)
    if unknown := sorted({*options.targets} - {*NAMES}):
        parser.error(f"unknown controller: {', '.join(unknown)}")
    digests = collect(options.targets, options.keep)
    found = changes(read_digests(options.targets), digests)
    print(*found, f"{len(digests)} outputs, {len(found)} differ", sep="\n")
    if options.update:
        write_digests(digests, options.targets)
    return int(bool(found) and not options.update)


if __name__ == "__main__":
    sys.exit(run())
