"""The one-bit PLC of Hryniewicz and Chmiel: its machine, its assembler, and programs for it."""
