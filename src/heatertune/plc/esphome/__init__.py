"""ESPHome's PID climate; DIFFERENCES.md lists the open points of its documents."""
