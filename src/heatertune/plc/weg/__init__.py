"""WEG's PID block in the SCA06 Ladder; what its manual leaves open stands in DIFFERENCES.md."""
