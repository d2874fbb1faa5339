"""A dataset, or a first guess, that a person edits: every step can be undone, nothing is lost."""
