"""Small nodes around the playing of bags."""
