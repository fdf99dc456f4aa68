"""PID_Temp of the S7-1200/1500, heating; it computes as `heatertune.plc.pid_compact` does."""
