"""ESPHome's PID climate; what its documents leave open stands in DIFFERENCES.md."""
