"""WEG's PID block in the SCA06 Ladder; DIFFERENCES.md lists the open points of its manual."""
