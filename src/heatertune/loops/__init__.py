"""Loops that run: what a log of one says of its health, why, and which words would cure it."""
