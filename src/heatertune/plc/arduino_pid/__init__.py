"""Brett Beauregard's PID_v1 for Arduino; what its source leaves to the sketch stands in DIFFERENCES.md."""
