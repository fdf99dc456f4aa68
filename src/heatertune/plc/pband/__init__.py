"""Panel instruments that hold a proportional band, Ti and Td: one law, a table of makes; see DIFFERENCES.md."""
