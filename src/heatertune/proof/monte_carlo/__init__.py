"""Heaters, noise and delays drawn at random: how many of them a set of words serves."""
