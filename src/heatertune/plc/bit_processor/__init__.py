"""The one-bit PLC of Hryniewicz and Chmiel, its programs, and the two-level control it runs."""
