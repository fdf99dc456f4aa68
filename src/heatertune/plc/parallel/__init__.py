"""The parallel form u = P + I + D of makers and printers: one step for four controllers, each with its own law."""
