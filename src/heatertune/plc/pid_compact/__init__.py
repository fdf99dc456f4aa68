"""PID_Compact of the S7-1200/1500; what its manual leaves open stands in DIFFERENCES.md."""
