"""Worked examples: the simulated collaborative cell."""
