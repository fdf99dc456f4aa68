"""The Python package simple-pid; DIFFERENCES.md lists what depends on its caller."""
