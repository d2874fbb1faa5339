"""Nodes: parameters in, messages to the library and back."""
