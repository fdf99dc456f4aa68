"""The PID controller OB251 of the SIMATIC S5-115U; what the manual leaves open stands in DIFFERENCES.md."""
