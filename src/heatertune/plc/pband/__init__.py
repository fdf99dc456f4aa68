"""Panel instruments with proportional band, Ti and Td: one control law, a table of makes; see DIFFERENCES.md."""
