"""Words + plausible heaters → a monitor of whole numbers without false trips, and how soon it detects each fault."""
