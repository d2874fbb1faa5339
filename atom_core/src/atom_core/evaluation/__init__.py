"""How good a calibration is: pair by pair on a test set, and against the truth."""
