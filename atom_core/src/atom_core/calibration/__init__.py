"""The calibration from dataset to result: checks, initial values, solve, what is weak."""
