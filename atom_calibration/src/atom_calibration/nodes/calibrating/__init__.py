"""Nodes that calibrate while RViz shows it."""
