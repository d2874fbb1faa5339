"""Geometry on numpy arrays: rigid motions, cameras, planes, the rectangle of a board."""
