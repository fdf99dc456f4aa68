"""`python -m heatertune` is the command line."""

import sys

from heatertune.cli import main

if __name__ == "__main__":  # processes that the studio begins import this file
    sys.exit(main())
