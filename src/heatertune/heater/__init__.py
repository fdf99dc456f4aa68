"""The heater's own equation: what one or two lags answer to held power."""
