"""Two-level control on the one-bit PLC of Hryniewicz and Chmiel; see DIFFERENCES.md."""
