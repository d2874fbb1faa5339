"""Labeled frames in, collections of a dataset out."""
