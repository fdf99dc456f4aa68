"""The closed loop for 32 heaters side by side, see `heatertune.proof.lanes.side_by_side`."""
