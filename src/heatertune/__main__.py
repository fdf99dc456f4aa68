"""`python -m heatertune` is the command line."""

import sys

from heatertune.cli import main

sys.exit(main())
