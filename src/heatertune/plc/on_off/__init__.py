"""The two-level control that the one-bit PLC of Hryniewicz and Chmiel runs; see DIFFERENCES.md."""
