"""Solvers: options in, summary out."""
