"""The searches: settings of least cost within their limits, real or in whole numbers."""
