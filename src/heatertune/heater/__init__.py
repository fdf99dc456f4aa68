"""The heater equation: the response of one or two lags to piecewise constant power."""
