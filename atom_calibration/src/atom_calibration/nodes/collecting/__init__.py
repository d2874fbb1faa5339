"""Nodes and commands that label data and collect datasets."""
