"""The Python package simple-pid; what it leaves to its caller stands in DIFFERENCES.md."""
