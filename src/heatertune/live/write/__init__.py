"""Words into a running PLC: only proven ones, only where they were expected, and back again."""
