"""PID_Compact of the S7-1200/1500; DIFFERENCES.md lists the open points of its manual."""
