"""Brett Beauregard's PID_v1 for Arduino; DIFFERENCES.md lists what its source leaves to the sketch."""
