"""The node with which a first guess is made."""
