"""The searches: parameters of least cost within their limits, real or integer."""
