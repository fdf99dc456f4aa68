"""The PID controller OB251 of the SIMATIC S5-115U; DIFFERENCES.md lists the open points of its manual."""
