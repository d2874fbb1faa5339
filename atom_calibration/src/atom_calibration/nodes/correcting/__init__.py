"""Nodes to go through a dataset and to correct it."""
