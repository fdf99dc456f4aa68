"""Words + plausible heaters → a monitor of whole numbers that never trips for nothing, and how soon it tells a fault."""
